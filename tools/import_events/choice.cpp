#include "tools/import_events/choice.h"

#include <algorithm>
#include <map>

#include "command_line/program.h"
#include "sprag/contact_event.h"
#include "sprag/detail/files/csv.h"

namespace sprag {

namespace {

struct NamedColumn {
  ColumnRole role;
  std::optional<std::int64_t> contact;  // from 1
  std::string name;
};

std::string counted(std::int64_t count, const std::string& noun) {
  return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
}

std::string option_text(ColumnRole role) {
  if (role == ColumnRole::impacts) return "--impacts";
  if (role == ColumnRole::level) return "--level";
  return role == ColumnRole::on ? "--on" : "--off";
}

NamedColumn parse_option(const ColumnOption& option) {
  const std::size_t sign = option.text.find('=');
  const auto digits = option.text.substr(0, sign);
  const bool numbered = sign != std::string::npos && !digits.empty() &&
                        digits.find_first_not_of("0123456789") == std::string::npos;
  if (!numbered) return {option.role, std::nullopt, option.text};
  const auto contact = parse_integer(digits);
  // A number that does not fit is larger than the number of contacts of every scene.
  return {option.role, contact.value_or(max_contacts + 1), option.text.substr(sign + 1)};
}

void number_contacts(std::vector<NamedColumn>& named) {
  std::vector<std::int64_t> ons;
  std::int64_t last = 0;
  for (NamedColumn& column : named) {
    if (column.role == ColumnRole::off) continue;
    column.contact = ++last;
    if (column.role == ColumnRole::on) ons.push_back(last);
  }
  std::size_t pair = 0;
  for (NamedColumn& column : named) {
    if (column.role != ColumnRole::off) continue;
    if (pair == ons.size()) throw UsageError("--off " + column.name + " has no --on");
    column.contact = ons[pair++];
  }
}

std::vector<NamedColumn> numbered(const std::vector<ColumnOption>& options) {
  std::vector<NamedColumn> named;
  named.reserve(options.size());
  for (const ColumnOption& option : options) named.push_back(parse_option(option));
  const auto with_number =
      std::ranges::count_if(named, [](const auto& column) { return column.contact.has_value(); });
  if (with_number == 0) {
    number_contacts(named);
  } else if (with_number < std::ssize(named)) {
    throw UsageError("some columns are given as CONTACT=NAME and some as NAME; must all be alike");
  }
  return named;
}

void check_contact(const NamedColumn& column, int contacts, const std::string& of_scene) {
  if (*column.contact >= 1 && *column.contact <= contacts) return;
  throw UsageError(option_text(column.role) + " " + column.name + " is for contact " +
                   std::to_string(*column.contact) + "; " + of_scene + ", counted from 1");
}

[[noreturn]] void refuse_second(const NamedColumn& column) {
  throw UsageError(option_text(column.role) + " " + column.name + " is a second " +
                   option_text(column.role) + " for contact " + std::to_string(*column.contact));
}

void check_complete(const ContactColumns& columns) {
  const std::string contact = "contact " + std::to_string(columns.contact + 1) + " has ";
  if (columns.impacts && (columns.on || columns.off))
    throw UsageError(contact + "--impacts and --on or --off; must be either");
  if (columns.level && (columns.impacts || columns.on || columns.off))
    throw UsageError(contact + "--level and --impacts, --on or --off; must be either");
  if (columns.on && !columns.off) throw UsageError(contact + "--on without --off");
  if (columns.off && !columns.on) throw UsageError(contact + "--off without --on");
}

}  // namespace

std::vector<ContactColumns> choose_columns(const std::vector<ColumnOption>& options,
                                           const ColumnFile& columns, int contacts,
                                           const std::string& file) {
  const std::string of_scene = "the scene has " + counted(contacts, "contact");
  if (options.empty()) {
    if (columns.columns.size() == 1 && contacts == 1)
      return {{.contact = 0, .impacts = 0, .on = {}, .off = {}}};
    throw UsageError(file + " has " + counted(std::ssize(columns.columns), "column") + " and " +
                     of_scene + "; name the columns with --impacts, or --on and --off, or --level");
  }
  std::map<std::int64_t, ContactColumns> chosen;
  for (const NamedColumn& column : numbered(options)) {
    check_contact(column, contacts, of_scene);
    ContactColumns& contact = chosen[*column.contact];
    contact.contact = static_cast<int>(*column.contact) - 1;
    auto& place = column.role == ColumnRole::impacts ? contact.impacts
                  : column.role == ColumnRole::on    ? contact.on
                  : column.role == ColumnRole::level ? contact.level
                                                     : contact.off;
    if (place) refuse_second(column);
    place = columns.find(column.name, file);
  }
  std::vector<ContactColumns> result;
  for (const auto& [contact, of_contact] : chosen) {
    check_complete(of_contact);
    result.push_back(of_contact);
  }
  return result;
}

}  // namespace sprag
