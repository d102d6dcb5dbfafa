#include "lcmtypes/key.h"

#include <sodium.h>

#include <cctype>
#include <stdexcept>
#include <string>

#include "sprag/detail/files/input_file.h"

namespace sprag {
namespace {

static_assert(Key::size == crypto_generichash_KEYBYTES);
static_assert(Key::tag_size == crypto_generichash_BYTES);

void prepare() {
  if (sodium_init() < 0) throw std::runtime_error("libsodium cannot be used");
}

}  // namespace

Key::Key(const std::filesystem::path& file) {
  prepare();
  const std::string text = read_whole(file);
  std::size_t length = 0;
  const char* end = nullptr;
  const auto is_space = [](char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; };
  std::size_t first = 0;
  while (first < text.size() && is_space(text[first])) ++first;
  sodium_hex2bin(key_.data(), key_.size(), text.data() + first, text.size() - first, nullptr,
                 &length, &end);
  const auto used = static_cast<std::size_t>(end - text.data());
  bool nothing_follows = true;
  for (std::size_t i = used; i < text.size(); ++i) nothing_follows &= is_space(text[i]);
  if (length != size || !nothing_follows) {
    throw InputError(file.string() +
                     ": is no key; must hold 64 hexadecimal digits, as made by: openssl rand -hex "
                     "32");
  }
}

Key::Key(const std::array<std::uint8_t, size>& bytes) : key_(bytes) { prepare(); }

Key::Tag Key::tag(std::string_view channel, std::span<const std::uint8_t> message) const noexcept {
  Tag tag{};
  crypto_generichash_state state;
  crypto_generichash_init(&state, key_.data(), key_.size(), tag.size());
  // The zero separates the name from the message.
  crypto_generichash_update(&state, reinterpret_cast<const std::uint8_t*>(channel.data()),
                            channel.size());
  const std::uint8_t zero = 0;
  crypto_generichash_update(&state, &zero, 1);
  crypto_generichash_update(&state, message.data(), message.size());
  crypto_generichash_final(&state, tag.data(), tag.size());
  return tag;
}

bool Key::verifies(std::string_view channel, std::span<const std::uint8_t> tagged) const noexcept {
  if (tagged.size() < tag_size) return false;
  const std::size_t length = tagged.size() - tag_size;
  const Tag expected = tag(channel, tagged.first(length));
  return sodium_memcmp(expected.data(), tagged.data() + length, tag_size) == 0;
}

}  // namespace sprag
