#include "sprag/detail/files/impacts_file.h"

#include "sprag/detail/files/csv.h"

namespace sprag {
namespace {

constexpr const char* impacts_header =
    "t,contact,kind,from_filter,time,sigma_time,velocity_before,sigma_velocity_before,"
    "velocity_after,sigma_velocity_after,impulse,sigma_impulse,force_begin,sigma_force_begin,"
    "force_end,sigma_force_end,force_largest,sigma_force_largest,force_impulse,"
    "sigma_force_impulse";

}  // namespace

const char* name(ContactEventKind kind) {
  switch (kind) {
    case ContactEventKind::closes:
      return "closes";
    case ContactEventKind::opens:
      return "opens";
    default:
      return "impact";
  }
}

ImpactsWriter::ImpactsWriter(const std::filesystem::path& file)
    : CsvWriter(OutputFile(file), impacts_header, 512) {}

void ImpactsWriter::write(const ImpactRecord& record) noexcept {
  row_.clear();
  append_number(row_, record.t);
  row_ += ',';
  append_number(row_, std::int64_t{record.contact} + 1);
  row_ += ',';
  row_ += name(record.kind);
  row_ += record.from_filter ? ",1" : ",0";
  for (const Uncertain& x : {record.time, record.before, record.after, record.impulse}) {
    row_ += ',';
    append_number(row_, x.value);
    row_ += ',';
    append_number(row_, x.sigma);
  }
  for (const Uncertain& x :
       {record.force_begin, record.force_end, record.force_largest, record.force_impulse}) {
    row_ += ',';
    if (record.sustained) append_number(row_, x.value);
    row_ += ',';
    if (record.sustained) append_number(row_, x.sigma);
  }
  row_ += '\n';
  file_.write(row_);
}

}  // namespace sprag
