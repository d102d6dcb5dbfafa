// Prints a scene's contact events, one line `t contact kind` each. Built twice, with and without
// optimization.
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <vector>

#include "sprag/detail/mechanics/master.h"
#include "sprag/scene_file.h"

int main(int argc, char** argv) try {
  if (argc != 3) return 2;
  const sprag::Scene scene = sprag::read_scene(argv[1]);
  sprag::Master master(scene.model, scene.truth.start);
  std::vector<sprag::ContactEvent> events;
  master.advance(sprag::at(std::strtod(argv[2], nullptr)), events);
  for (const sprag::ContactEvent& event : events) {
    std::printf("%.17g %d %d\n", event.t, event.contact + 1, static_cast<int>(event.kind));
  }
  return 0;
} catch (const std::exception& e) {
  std::fprintf(stderr, "%s\n", e.what());
  return 1;
}
