#include "sprag/detail/files/impacts_file.h"

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
  add(record.t);
  add(std::int64_t{record.contact} + 1);
  add(name(record.kind));
  add(record.from_filter ? "1" : "0");
  for (const Uncertain& x : {record.time, record.before, record.after, record.impulse}) {
    add(x.value);
    add(x.sigma);
  }
  for (const Uncertain& x :
       {record.force_begin, record.force_end, record.force_largest, record.force_impulse}) {
    for (const double number : {x.value, x.sigma}) record.sustained ? add(number) : add("");
  }
  end_row();
}

}  // namespace sprag
