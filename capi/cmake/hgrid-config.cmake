# find_package(hgrid) gives the targets
#
#   hgrid::hgrid     the shared library
#   hgrid::static    the static one, which needs no other library
#
# as far as they are installed. Everything is found from where this file lies, which is
# <prefix>/share/cmake/hgrid, so the whole prefix can be moved.

get_filename_component(_hgrid_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)

# The system's usual folders: cargo cinstall puts libraries into one of them.
set(_hgrid_libdirs "lib/${CMAKE_LIBRARY_ARCHITECTURE}" lib64 lib)
if(CMAKE_SIZEOF_VOID_P EQUAL 4)
  list(REMOVE_ITEM _hgrid_libdirs lib64)
endif()
set(_hgrid_includedir include)
set(_hgrid_definitions "")
# An install by CMake and an archive say where they put things, and whether hgrid_create is there.
include("${CMAKE_CURRENT_LIST_DIR}/hgrid-build.cmake" OPTIONAL)

get_filename_component(_hgrid_includedir "${_hgrid_includedir}" ABSOLUTE BASE_DIR "${_hgrid_prefix}")
foreach(_hgrid_dir IN LISTS _hgrid_libdirs)
  get_filename_component(_hgrid_dir "${_hgrid_dir}" ABSOLUTE BASE_DIR "${_hgrid_prefix}")
  set(_hgrid_shared
    "${_hgrid_dir}/${CMAKE_SHARED_LIBRARY_PREFIX}hgrid${CMAKE_SHARED_LIBRARY_SUFFIX}")
  set(_hgrid_static
    "${_hgrid_dir}/${CMAKE_STATIC_LIBRARY_PREFIX}hgrid${CMAKE_STATIC_LIBRARY_SUFFIX}")
  # On Windows programs find what is in bin, and linkers a library beside the static one. These are
  # the names that Rust gives.
  set(_hgrid_import "")
  if(WIN32)
    set(_hgrid_shared "${_hgrid_prefix}/bin/hgrid.dll")
    set(_hgrid_import "${_hgrid_dir}/libhgrid.dll.a")
    # clang can have Microsoft's ABI where CMake does not set MSVC.
    if(MSVC OR CMAKE_C_SIMULATE_ID MATCHES "^MSVC$" OR CMAKE_CXX_SIMULATE_ID MATCHES "^MSVC$")
      set(_hgrid_import "${_hgrid_dir}/hgrid.dll.lib")
    endif()
  endif()
  if(EXISTS "${_hgrid_shared}" AND NOT TARGET hgrid::hgrid)
    add_library(hgrid::hgrid SHARED IMPORTED)
    set_target_properties(hgrid::hgrid PROPERTIES
      IMPORTED_LOCATION "${_hgrid_shared}"
      IMPORTED_IMPLIB "${_hgrid_import}"
      INTERFACE_COMPILE_DEFINITIONS "${_hgrid_definitions}"
      INTERFACE_INCLUDE_DIRECTORIES "${_hgrid_includedir}")
  endif()
  if(EXISTS "${_hgrid_static}" AND NOT TARGET hgrid::static)
    add_library(hgrid::static STATIC IMPORTED)
    set_target_properties(hgrid::static PROPERTIES
      IMPORTED_LOCATION "${_hgrid_static}"
      INTERFACE_COMPILE_DEFINITIONS "${_hgrid_definitions}"
      INTERFACE_INCLUDE_DIRECTORIES "${_hgrid_includedir}")
  endif()
endforeach()

if(NOT TARGET hgrid::hgrid AND NOT TARGET hgrid::static)
  set(hgrid_FOUND FALSE)
  set(hgrid_NOT_FOUND_MESSAGE "there is no hgrid library beneath ${_hgrid_prefix}")
endif()

unset(_hgrid_prefix)
unset(_hgrid_libdirs)
unset(_hgrid_includedir)
unset(_hgrid_definitions)
unset(_hgrid_dir)
unset(_hgrid_shared)
unset(_hgrid_static)
unset(_hgrid_import)
