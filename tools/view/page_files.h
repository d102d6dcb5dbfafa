// The files of the page, embedded in the program by embed.cmake.
#pragma once

#include <span>

#include "tools/view/gateway/rules.h"

namespace sprag::view {

std::span<const PageFile> page_files();

}  // namespace sprag::view
