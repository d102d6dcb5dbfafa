// The files of the page, which the program carries within itself (embed.cmake).
#pragma once

#include <span>

#include "tools/view/gateway/rules.h"

namespace sprag::view {

std::span<const PageFile> page_files();

}  // namespace sprag::view
