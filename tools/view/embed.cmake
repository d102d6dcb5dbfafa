# Writes a C++ source that contains the files of a page.
# cmake -DOUTPUT=F.cpp -DFILES="/path|type|file;..." -P embed.cmake
set(arrays "")
set(table "")
set(number 0)
foreach(entry IN LISTS FILES)
  string(REPLACE "|" ";" entry "${entry}")
  list(GET entry 0 path)
  list(GET entry 1 type)
  list(GET entry 2 file)
  if(type MATCHES "^text/")
    string(APPEND type "; charset=utf-8")
  endif()
  file(READ ${file} bytes HEX)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
  string(REGEX REPLACE "(0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,)"
    "\\1\n" bytes "${bytes}")
  string(APPEND arrays "constexpr unsigned char file_${number}[] = {\n${bytes}};\n")
  string(APPEND table "    {\"${path}\", \"${type}\", file_${number}},\n")
  math(EXPR number "${number} + 1")
endforeach()
file(WRITE ${OUTPUT} "#include \"tools/view/page_files.h\"

namespace sprag::view {
namespace {

${arrays}
constexpr PageFile all_files[] = {
${table}};

}  // namespace

std::span<const PageFile> page_files() { return all_files; }

}  // namespace sprag::view
")
