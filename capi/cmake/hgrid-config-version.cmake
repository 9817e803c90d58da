# Is this version good for a program that asks for another?
set(PACKAGE_VERSION 0.1.0)

if(PACKAGE_FIND_VERSION_RANGE)
  # It names the versions it is good for: find_package(hgrid 0.1...<0.3).
  if(PACKAGE_VERSION VERSION_LESS PACKAGE_FIND_VERSION_MIN
      OR PACKAGE_VERSION VERSION_GREATER PACKAGE_FIND_VERSION_MAX
      OR (PACKAGE_FIND_VERSION_RANGE_MAX STREQUAL "EXCLUDE"
        AND PACKAGE_VERSION VERSION_EQUAL PACKAGE_FIND_VERSION_MAX))
    set(PACKAGE_VERSION_COMPATIBLE FALSE)
  else()
    set(PACKAGE_VERSION_COMPATIBLE TRUE)
  endif()
elseif(PACKAGE_VERSION VERSION_LESS PACKAGE_FIND_VERSION)
  set(PACKAGE_VERSION_COMPATIBLE FALSE)
else()
  # While the major version is 0, a new minor version may break programs: they name the one they know.
  string(REGEX MATCH "^[0-9]+\\.[0-9]+\\." _hgrid_has "${PACKAGE_VERSION}.")
  string(REGEX MATCH "^[0-9]+\\.[0-9]+\\." _hgrid_wants "${PACKAGE_FIND_VERSION}.")
  if(_hgrid_has STREQUAL _hgrid_wants)
    set(PACKAGE_VERSION_COMPATIBLE TRUE)
  else()
    set(PACKAGE_VERSION_COMPATIBLE FALSE)
  endif()
  if(PACKAGE_VERSION VERSION_EQUAL PACKAGE_FIND_VERSION)
    set(PACKAGE_VERSION_EXACT TRUE)
  endif()
endif()
