# Read by ctest after a list of tests that wait for real time: four of them run in parallel, beside two that
# compute.
set(lane 0)
foreach(test IN LISTS discovered)
  set_tests_properties("${test}" PROPERTIES RESOURCE_LOCK lane_${lane})
  math(EXPR lane "(${lane} + 1) % 4")
endforeach()
