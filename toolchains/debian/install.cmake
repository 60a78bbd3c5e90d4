# What `cmake --install` and the Debian packages hold. Component `program`: the package epiline. `library`: libepiline1, for C.
# `development`: libepiline-dev, headers and static libraries for C++ of what flies. `python`: python3-epiline.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(libraries epiline_options epiline_platform epiline_estimator epiline_pipeline epiline_links epiline_sensors)
foreach(library ${libraries})
  string(REPLACE "epiline_" "" name ${library})
  set_target_properties(${library} PROPERTIES EXPORT_NAME ${name})
endforeach()
# Eigen's alignment follows the instruction set it is compiled for, and so would the layout of our structs.
target_compile_definitions(epiline_estimator INTERFACE $<INSTALL_INTERFACE:EIGEN_MAX_ALIGN_BYTES=16>)
install(TARGETS ${libraries} EXPORT epiline-targets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
install(DIRECTORY platform estimator pipeline DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/epiline COMPONENT development
  FILES_MATCHING PATTERN "*.h")
foreach(room links sensors)
  install(DIRECTORY drivers/${room} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/epiline/drivers COMPONENT development
    FILES_MATCHING PATTERN "*.h")
endforeach()

install(TARGETS epiline_c LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library NAMELINK_COMPONENT development)
install(FILES pipeline/library/epiline.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development)
file(RELATIVE_PATH prefix_from_pc /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
configure_file(toolchains/debian/epiline.pc.in ${PROJECT_BINARY_DIR}/package/epiline.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/package/epiline.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)

set(python_folder lib/python3/dist-packages/epiline)
install(TARGETS epiline_python LIBRARY DESTINATION ${python_folder} COMPONENT python)
install(DIRECTORY drivers/study/library/python/epiline/ DESTINATION ${python_folder} COMPONENT python
  FILES_MATCHING PATTERN "*.py" PATTERN "py.typed")

set(cmake_folder ${CMAKE_INSTALL_LIBDIR}/cmake/epiline)
install(EXPORT epiline-targets NAMESPACE epiline:: DESTINATION ${cmake_folder} COMPONENT development)
configure_package_config_file(toolchains/debian/epiline-config.cmake.in ${PROJECT_BINARY_DIR}/package/epiline-config.cmake
  INSTALL_DESTINATION ${cmake_folder})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/package/epiline-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/package/epiline-config.cmake ${PROJECT_BINARY_DIR}/package/epiline-config-version.cmake
  DESTINATION ${cmake_folder} COMPONENT development)

# The manual page's lists of commands, options and settings are what the program says of itself.
set(manual ${PROJECT_BINARY_DIR}/package/epiline.1.gz)
add_custom_command(OUTPUT ${manual} VERBATIM
  DEPENDS epiline ${PROJECT_SOURCE_DIR}/toolchains/debian/make_manual ${PROJECT_SOURCE_DIR}/toolchains/debian/epiline.1.in
  COMMAND ${PROJECT_SOURCE_DIR}/toolchains/debian/make_manual ${PROJECT_SOURCE_DIR}/toolchains/debian/epiline.1.in ${manual}
    ${CMAKE_CROSSCOMPILING_EMULATOR} $<TARGET_FILE:epiline>)
add_custom_target(manual DEPENDS ${manual})

install(TARGETS epiline RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)
install(FILES ${manual} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program)
install(DIRECTORY docs/examples/ DESTINATION ${CMAKE_INSTALL_DOCDIR}/examples COMPONENT program FILES_MATCHING PATTERN "*.toml"
  PATTERN "*.yaml")
install(DIRECTORY docs/examples/library DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libepiline-dev/examples COMPONENT development)
include(toolchains/debian/serial_devices.cmake)
install(FILES ${PROJECT_BINARY_DIR}/package/epiline.service DESTINATION lib/systemd/system COMPONENT program)
install(FILES ${PROJECT_BINARY_DIR}/package/70-epiline.rules DESTINATION lib/udev/rules.d COMPONENT program)
install(FILES toolchains/debian/epiline.bash-completion DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME epiline
  COMPONENT program)

# Packages for two releases of Debian differ, so their versions do: apt must be able to tell them apart, and an upgrade of the
# release must bring the newer one.
set(package_release 1)
if(EXISTS /etc/os-release)
  file(STRINGS /etc/os-release system REGEX "^(ID|VERSION_ID|VERSION_CODENAME)=")
  string(REGEX REPLACE "[;\"]" " " system " ${system} ")
  if(system MATCHES " ID=debian " AND system MATCHES "VERSION_ID= ?([0-9]+)")
    set(package_release 1+deb${CMAKE_MATCH_1}u0)
  endif()
  if(system MATCHES "VERSION_CODENAME=([a-z]+)")
    set(package_suite ${CMAKE_MATCH_1})
  endif()
endif()
if(NOT package_suite)
  set(package_suite unstable)
endif()

# Debian wants licence and changelog in every package.
set(changelogs ${PROJECT_BINARY_DIR}/package/changelog.gz ${PROJECT_BINARY_DIR}/package/changelog.Debian.gz)
configure_file(toolchains/debian/changelog.in ${PROJECT_BINARY_DIR}/package/changelog.Debian @ONLY)
add_custom_command(OUTPUT ${changelogs} VERBATIM
  DEPENDS ${PROJECT_SOURCE_DIR}/CHANGELOG.md ${PROJECT_BINARY_DIR}/package/changelog.Debian
  COMMAND sh -c "gzip -9nc \"$1\" >changelog.gz && gzip -9nkf changelog.Debian" sh ${PROJECT_SOURCE_DIR}/CHANGELOG.md
  WORKING_DIRECTORY ${PROJECT_BINARY_DIR}/package)
set(package_of_program epiline)
set(package_of_development libepiline-dev)
set(package_of_library libepiline1)
set(package_of_python python3-epiline)
foreach(component program development library python)
  set(package ${package_of_${component}})
  install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} RENAME copyright COMPONENT ${component})
  install(FILES ${changelogs} DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} COMPONENT ${component})
endforeach()

# All that the packages hold, and nothing else: what must be built before cpack.
add_custom_target(packaged DEPENDS ${manual} ${changelogs} epiline epiline_platform epiline_estimator epiline_pipeline
  epiline_links epiline_sensors epiline_c epiline_python)
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_VENDOR "The epiline authors")
set(CPACK_PACKAGE_CONTACT "The epiline authors <epiline@localhost>")
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/package)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_COMPONENTS_ALL program development library python)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_STRIP_FILES ON)
set(CPACK_VERBATIM_VARIABLES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE ${package_release})
if(CMAKE_SYSTEM_PROCESSOR STREQUAL "aarch64")
  set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE arm64)
endif()
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME epiline)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS adduser)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS ${EPILINE_CYCLONEDDS_PACKAGE})
if(CMAKE_CROSSCOMPILING)
  set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${CMAKE_SYSROOT}/lib/${CMAKE_LIBRARY_ARCHITECTURE}
    ${CMAKE_SYSROOT}/usr/lib/${CMAKE_LIBRARY_ARCHITECTURE})
endif()
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION "visual-inertial odometry without a map
A camera and an IMU go in; position, velocity, attitude, their covariance and
an honest statement of health come out, to a flight controller over MAVLink
or onto a CAN bus.")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_CONTROL_EXTRA ${PROJECT_SOURCE_DIR}/toolchains/debian/postinst
  ${PROJECT_SOURCE_DIR}/toolchains/debian/prerm ${PROJECT_SOURCE_DIR}/toolchains/debian/postrm)

set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME libepiline1)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SHLIBDEPS ON)
set(CPACK_COMPONENT_LIBRARY_DESCRIPTION "visual-inertial odometry as a library for C
Takes IMU samples and images, or tracks, and gives position, velocity,
attitude, their covariance and health.")

set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-epiline)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3, python3-numpy")
set(CPACK_COMPONENT_PYTHON_DESCRIPTION "visual-inertial odometry for Python
Replays recorded flights, evaluates trajectories, and estimates odometry
from samples as they come; results are arrays of numpy.")

set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libepiline-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "libepiline1 (= ${PROJECT_VERSION}-${package_release}), libeigen3-dev, libfmt-dev, libhwy-dev,
 libjpeg-dev, libtomlplusplus-dev, libyaml-cpp-dev, zlib1g-dev")
if(GPIOD_FOUND)
  string(APPEND CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS ", libgpiod-dev")
endif()
if(EPILINE_NETTLE_LIBRARY)
  string(APPEND CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS ", nettle-dev")
endif()
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "visual-inertial odometry as a library
Headers, static libraries and CMake files of epiline's estimator, of its
pipeline from images to odometry, and of its drivers of cameras, IMUs and
outputs; the header for C.")
include(CPack)
