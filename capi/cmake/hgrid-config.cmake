# find_package(hgrid) gives the targets
#
#   hgrid::hgrid     the shared library
#   hgrid::static    the static one, which needs no other library
#
# as far as they are installed. Everything is found from where this file lies, which is
# <prefix>/share/cmake/hgrid, so the whole prefix can be moved.

get_filename_component(_hgrid_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)

# cargo cinstall puts libraries where the system's own ones lie, or where --libdir says.
foreach(_hgrid_dir "lib/${CMAKE_LIBRARY_ARCHITECTURE}" lib64 lib)
  set(_hgrid_dir "${_hgrid_prefix}/${_hgrid_dir}")
  set(_hgrid_shared
    "${_hgrid_dir}/${CMAKE_SHARED_LIBRARY_PREFIX}hgrid${CMAKE_SHARED_LIBRARY_SUFFIX}")
  set(_hgrid_static
    "${_hgrid_dir}/${CMAKE_STATIC_LIBRARY_PREFIX}hgrid${CMAKE_STATIC_LIBRARY_SUFFIX}")
  if(EXISTS "${_hgrid_shared}" AND NOT TARGET hgrid::hgrid)
    add_library(hgrid::hgrid SHARED IMPORTED)
    set_target_properties(hgrid::hgrid PROPERTIES
      IMPORTED_LOCATION "${_hgrid_shared}"
      INTERFACE_INCLUDE_DIRECTORIES "${_hgrid_prefix}/include")
  endif()
  if(EXISTS "${_hgrid_static}" AND NOT TARGET hgrid::static)
    add_library(hgrid::static STATIC IMPORTED)
    set_target_properties(hgrid::static PROPERTIES
      IMPORTED_LOCATION "${_hgrid_static}"
      INTERFACE_INCLUDE_DIRECTORIES "${_hgrid_prefix}/include")
  endif()
endforeach()

if(NOT TARGET hgrid::hgrid AND NOT TARGET hgrid::static)
  set(hgrid_FOUND FALSE)
  set(hgrid_NOT_FOUND_MESSAGE "there is no hgrid library beneath ${_hgrid_prefix}")
endif()

unset(_hgrid_prefix)
unset(_hgrid_dir)
unset(_hgrid_shared)
unset(_hgrid_static)
