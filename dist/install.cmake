# Chooses the files and places of `cmake --install`. capi/cmake finds them relative to itself.
include(GNUInstallDirs)

# hgrid.pc gives places relative to its own folder, so that the prefix can be moved.
set(prefix "${CMAKE_INSTALL_PREFIX}")
if(NOT IS_ABSOLUTE "${CMAKE_INSTALL_LIBDIR}")
  file(RELATIVE_PATH up "/prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig" /prefix)
  string(REGEX REPLACE "/$" "" up "${up}")
  set(prefix "\${pcfiledir}/${up}")
endif()
foreach(dir lib include)
  string(TOUPPER ${dir} upper)
  set(${dir}dir "${CMAKE_INSTALL_${upper}DIR}")
  if(NOT IS_ABSOLUTE "${${dir}dir}")
    set(${dir}dir "\${prefix}/${${dir}dir}")
  endif()
endforeach()
set(version "${PROJECT_VERSION}")
if(definitions)
  list(TRANSFORM definitions PREPEND " -D" OUTPUT_VARIABLE definitions)
endif()
configure_file(dist/hgrid.pc.in hgrid.pc @ONLY)

file(WRITE "${CMAKE_CURRENT_BINARY_DIR}/hgrid-build.cmake"
  "# Settings with which CMake built and installed this hgrid.\n"
  "set(_hgrid_libdirs \"${CMAKE_INSTALL_LIBDIR}\")\n"
  "set(_hgrid_includedir \"${CMAKE_INSTALL_INCLUDEDIR}\")\n")
if(HGRID_MALLOC)
  file(APPEND "${CMAKE_CURRENT_BINARY_DIR}/hgrid-build.cmake" "set(_hgrid_definitions HGRID_MALLOC)\n")
endif()

install(FILES include/hgrid.h include/hgrid.hpp DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
install(FILES "${to}/${static}" DESTINATION "${CMAKE_INSTALL_LIBDIR}")
if(HGRID_SHARED AND WIN32)
  install(PROGRAMS "${to}/${shared}" DESTINATION "${CMAKE_INSTALL_BINDIR}")
  install(FILES "${to}/${import}" DESTINATION "${CMAKE_INSTALL_LIBDIR}")
elseif(HGRID_SHARED)
  install(PROGRAMS "${to}/${shared}" DESTINATION "${CMAKE_INSTALL_LIBDIR}")
  foreach(name IN LISTS links)
    install(FILES "${to}/${name}" DESTINATION "${CMAKE_INSTALL_LIBDIR}")
  endforeach()
endif()
install(FILES "${CMAKE_CURRENT_BINARY_DIR}/hgrid.pc" DESTINATION "${CMAKE_INSTALL_LIBDIR}/pkgconfig")
install(FILES capi/cmake/hgrid-config.cmake capi/cmake/hgrid-config-version.cmake
  "${CMAKE_CURRENT_BINARY_DIR}/hgrid-build.cmake" DESTINATION share/cmake/hgrid)
install(FILES LICENSE-APACHE LICENSE-MIT DESTINATION "${CMAKE_INSTALL_DOCDIR}")
