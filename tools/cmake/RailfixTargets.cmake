# How every target of Railfix is made: one library a folder, one program a service, one test program a folder.

set(RAILFIX_SANITIZE "" CACHE STRING "Sanitizers for all our code, as for -fsanitize= (set by the presets asan, tsan and fuzz)")
option(RAILFIX_FUZZ "Programs of tests/fuzz with libFuzzer, which needs clang (set by the preset fuzz)" OFF)

find_program(RAILFIX_CCACHE ccache)
if(RAILFIX_CCACHE)
  set(CMAKE_C_COMPILER_LAUNCHER ${RAILFIX_CCACHE})
  # What ccache wants where headers are compiled ahead.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${RAILFIX_CCACHE})
endif()

if(RAILFIX_SANITIZE)
  add_compile_options(-fsanitize=${RAILFIX_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${RAILFIX_SANITIZE})
endif()
if(RAILFIX_FUZZ)
  add_compile_options(-fsanitize=fuzzer-no-link)
elseif(RAILFIX_SANITIZE)
  if(RAILFIX_SANITIZE MATCHES undefined)
    add_compile_options(-fno-sanitize=alignment)  # Fast DDS lends samples four bytes off theirs
  endif()
  set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O1 -g1 -DNDEBUG")  # compiled in half the time
endif()

# Picture and filter code is vectorised at O3.
set(CMAKE_CXX_FLAGS_RELEASE "-O3 -DNDEBUG")

# Strict warnings for our own code; generated code is compiled without them.
# -Wrestrict is off because g++ 12 warns of every `"text" + string` (GCC bug 105651). Under sanitizers it warns of the
# standard library, which stops nobody.
function(railfix_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion
                                           -Wnon-virtual-dtor -Woverloaded-virtual -Wimplicit-fallthrough
                                           $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)
  if(NOT RAILFIX_SANITIZE)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()

# Commands and tests ask, compare and print. At O1 a third less time goes into compiling them.
function(railfix_made_quickly target)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
endfunction()

# Most of a compiler's time goes into the headers of Fast DDS, JSON and GoogleTest: targets that ask, carry and test read
# them once for eight of their files. There a name of an anonymous namespace stands in all eight, and hides what a header
# calls the same: tests have namespaces of their own where they share names. Filters, matching and vision stay apart.
option(RAILFIX_TOGETHER "Compile several files of a target at once; off for ./dev lint, which wants each alone" ON)
function(railfix_compiled_together target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${RAILFIX_TOGETHER} UNITY_BUILD_BATCH_SIZE 8)
  # A file among others is none of its own to g++, which then warns of classes that hold what only this file knows.
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
endfunction()

# railfix_library(core SOURCES a.cpp DEPENDS x y)  -> target railfix_core, headers as <folder>/<header>.hpp
# TOGETHER: see railfix_compiled_together.
function(railfix_library name)
  cmake_parse_arguments(ARG "TOGETHER" "" "SOURCES;DEPENDS" ${ARGN})
  add_library(railfix_${name} STATIC ${ARG_SOURCES})
  if(ARG_TOGETHER)
    railfix_compiled_together(railfix_${name})
  endif()
  target_include_directories(railfix_${name} PUBLIC ${CMAKE_SOURCE_DIR}/common ${CMAKE_SOURCE_DIR}/services)
  target_link_libraries(railfix_${name} PUBLIC ${ARG_DEPENDS})
  railfix_warnings(railfix_${name})
endfunction()

# All services, and nothing else: what images are made of.
add_custom_target(railfix-services)

# railfix_service(odometry [TOGETHER] ALGORITHM a.cpp SERVICE odometry_service.cpp DEPENDS x)
#   -> library railfix_odometry (the algorithm, no DDS) and program railfix-odometry (main.cpp and the DDS side).
function(railfix_service name)
  cmake_parse_arguments(ARG "TOGETHER" "" "ALGORITHM;SERVICE;DEPENDS" ${ARGN})
  railfix_library(${name} SOURCES ${ARG_ALGORITHM} DEPENDS ${ARG_DEPENDS})
  if(ARG_TOGETHER)
    railfix_compiled_together(railfix_${name})
  endif()
  string(REPLACE "_" "-" program ${name})
  add_executable(railfix-${program} main.cpp ${ARG_SERVICE})
  railfix_compiled_together(railfix-${program})
  target_link_libraries(railfix-${program} PRIVATE railfix_${name} railfix_service)
  railfix_warnings(railfix-${program})
  add_dependencies(railfix-services railfix-${program})
  set_property(GLOBAL APPEND PROPERTY RAILFIX_SERVICES railfix-${program})
endfunction()

set(RAILFIX_BESIDE_OTHERS RESOURCE_GROUPS watched:1)
set(RAILFIX_ALONE RESOURCE_GROUPS watched:3 COST 1)
set(RAILFIX_STEPS_BACK RESOURCE_GROUPS computing:1)
set(RAILFIX_STEP_BACK nice -n 10)

# railfix_test(core SOURCES a_test.cpp DEPENDS railfix_core)  -> program railfix-test-core, run by CTest test by test.
# Three kinds share the machine (tests/machine.json). Those that wait most of their time, WAITS, run together and begin
# first, the longest before all. Others of a folder that sets RAILFIX_TESTS_RUN_ALONE watch how fast processes answer: one
# at a time, beside none that waits. All that is left COMPUTES, two at a time, and takes what these leave of the processors.
function(railfix_test name)
  cmake_parse_arguments(ARG "WAITS;COMPUTES" "TIMEOUT" "SOURCES;DEPENDS" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  if(RAILFIX_SANITIZE)
    math(EXPR ARG_TIMEOUT "10 * ${ARG_TIMEOUT}")  # so much slower is what is watched
  endif()
  add_executable(railfix-test-${name} ${ARG_SOURCES})
  railfix_compiled_together(railfix-test-${name})
  target_link_libraries(railfix-test-${name} PRIVATE ${ARG_DEPENDS} GTest::gmock GTest::gtest_main)
  target_include_directories(railfix-test-${name} PRIVATE ${CMAKE_SOURCE_DIR}/tests)
  target_compile_definitions(railfix-test-${name} PRIVATE RAILFIX_SOURCE_DIR="${CMAKE_SOURCE_DIR}"
                                                          RAILFIX_BIN_DIR="${CMAKE_RUNTIME_OUTPUT_DIRECTORY}")
  railfix_warnings(railfix-test-${name})
  railfix_made_quickly(railfix-test-${name})
  # GoogleTest's headers are compiled once for all tests (tests/CMakeLists.txt); a test of other options reads them anew.
  target_precompile_headers(railfix-test-${name} REUSE_FROM railfix-test-headers)
  target_compile_options(railfix-test-${name} PRIVATE -pthread $<$<CXX_COMPILER_ID:GNU>:-Wno-error=invalid-pch -fpch-preprocess>)
  # SIGABRT leaves a core of a program that hangs, which .ci/run prints: CTest's own end of it would leave nothing.
  math(EXPR last_second "${ARG_TIMEOUT} + 30")
  set(step_back)
  set(how)
  if(ARG_WAITS)
    set(how COST ${ARG_TIMEOUT} ${RAILFIX_BESIDE_OTHERS})
  elseif(RAILFIX_TESTS_RUN_ALONE AND NOT ARG_COMPUTES)
    set(how ${RAILFIX_ALONE})
  else()
    set(how ${RAILFIX_STEPS_BACK})
    set(step_back ${RAILFIX_STEP_BACK})
  endif()
  add_test(NAME ${name}
    COMMAND ${step_back} timeout --verbose --signal=ABRT ${ARG_TIMEOUT} $<TARGET_FILE:railfix-test-${name}>)
  set_tests_properties(${name} PROPERTIES TIMEOUT ${last_second} ${how})
endfunction()

# railfix_measuring_program(railfix-measure-survey SOURCES survey.cpp DEPENDS railfix_track)  -> that program: no timing
# loop of its own, it measures what the libraries do.
function(railfix_measuring_program program)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${program} ${ARG_SOURCES})
  target_link_libraries(${program} PRIVATE ${ARG_DEPENDS} railfix_measuring_tool)
  railfix_warnings(${program})
  railfix_made_quickly(${program})
endfunction()

# railfix_benchmark(odometry SOURCES a.cpp DEPENDS railfix_odometry)  -> program railfix-bench-odometry, run by ./dev bench
function(railfix_benchmark name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(railfix-bench-${name} ${ARG_SOURCES})
  target_link_libraries(railfix-bench-${name} PRIVATE ${ARG_DEPENDS} benchmark::benchmark_main)
  railfix_warnings(railfix-bench-${name})
endfunction()
