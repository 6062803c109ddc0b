# What nearly every file includes, parsed once a library. Sources still include what they use: the sanitize
# preset builds without precompiled headers.
set(ANGIOSPLINE_PRECOMPILE <algorithm> <array> <cmath> <functional> <limits> <map> <memory> <optional>
  <string> <utility> <vector> <Eigen/Core> <Eigen/Geometry> <tl/expected.hpp>)

# angiospline_library(<name> ROOMS <folder>... [HEADERS ... PRIVATE_HEADERS ... SOURCES ...] PUBLIC <targets> PRIVATE <targets>)
# One static library: target angiospline_<name>, alias Angiospline::<name>. Its files lie in rooms, subfolders
# that each name their own files by angiospline_room(); HEADERS (public), PRIVATE_HEADERS and SOURCES are
# for a library without rooms. PRECOMPILE: heavy headers that most of its files include, beside those of every library.
function(angiospline_library name)
  cmake_parse_arguments(ARG "" "" "ROOMS;HEADERS;PRIVATE_HEADERS;SOURCES;PUBLIC;PRIVATE;PRECOMPILE" ${ARGN})
  set(target angiospline_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  add_library(Angiospline::${name} ALIAS ${target})
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_include_directories(${target} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/angiospline>)
  target_link_libraries(${target} PUBLIC ${ARG_PUBLIC}
    PRIVATE ${ARG_PRIVATE} $<BUILD_INTERFACE:angiospline_warnings>)
  target_precompile_headers(${target} PRIVATE ${ANGIOSPLINE_PRECOMPILE} ${ARG_PRECOMPILE})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  install(TARGETS ${target} EXPORT AngiosplineTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  angiospline_install_headers(${ARG_HEADERS})
  set(ANGIOSPLINE_LIBRARY ${target})
  foreach(room IN LISTS ARG_ROOMS)
    add_subdirectory(${room})
  endforeach()
endfunction()

# angiospline_room(PUBLIC <headers> PRIVATE <headers> SOURCES <files>): the files of one room. PUBLIC headers
# are installed; PRIVATE ones serve this room and those above it in the same library. The architecture
# test holds both lists against the folder.
function(angiospline_room)
  cmake_parse_arguments(ARG "" "" "PUBLIC;PRIVATE;SOURCES" ${ARGN})
  target_sources(${ANGIOSPLINE_LIBRARY} PRIVATE ${ARG_SOURCES})
  angiospline_install_headers(${ARG_PUBLIC})
endfunction()

# Headers of the current folder, installed under the path that an include names.
function(angiospline_install_headers)
  file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
  install(FILES ${ARGN} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/angiospline/${folder})
endfunction()
