# Defines hgrid::hgrid and hgrid::static with the built libraries, for add_subdirectory or FetchContent of
# this archive.
cmake_minimum_required(VERSION 3.16...3.31)

set(hgrid_FOUND TRUE)
include("${CMAKE_CURRENT_SOURCE_DIR}/share/cmake/hgrid/hgrid-config.cmake")
if(NOT hgrid_FOUND)
  message(FATAL_ERROR "hgrid: ${hgrid_NOT_FOUND_MESSAGE}")
endif()
foreach(target hgrid::hgrid hgrid::static)
  if(TARGET ${target})
    set_target_properties(${target} PROPERTIES IMPORTED_GLOBAL TRUE)
  endif()
endforeach()
