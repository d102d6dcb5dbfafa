// A secret key shared by master, observer and logger, which authenticates their messages. Every
// message carries a tag: BLAKE2b keyed with it (libsodium's crypto_generichash) over the channel's
// name and the message.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

namespace sprag {

class Key {
 public:
  static constexpr std::size_t size = 32;      ///< bytes of the key
  static constexpr std::size_t tag_size = 32;  ///< bytes added to each message
  using Tag = std::array<std::uint8_t, tag_size>;

  /// Reads 64 hexadecimal digits; white space around them is allowed. Throws InputError
  /// (sprag/detail/files/input_file.h).
  explicit Key(const std::filesystem::path& file);
  explicit Key(const std::array<std::uint8_t, size>& bytes);

  Tag tag(std::string_view channel, std::span<const std::uint8_t> message) const noexcept;

  /// Whether `tagged`, a message followed by its tag, was made with this key for this channel.
  bool verifies(std::string_view channel, std::span<const std::uint8_t> tagged) const noexcept;

 private:
  std::array<std::uint8_t, size> key_{};
};

}  // namespace sprag
