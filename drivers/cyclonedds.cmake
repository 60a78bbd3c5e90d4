# The target epiline_cyclonedds, if Debian's cyclonedds-dev is there: nodes of ROS 2 read through it. The program loads the library
# when it is asked to publish, and so runs without; EPILINE_CYCLONEDDS_PACKAGE brings it.
find_path(EPILINE_CYCLONEDDS_INCLUDE dds/ddsi/ddsi_sertype.h)
find_library(EPILINE_CYCLONEDDS_LIBRARY ddsc)
mark_as_advanced(EPILINE_CYCLONEDDS_INCLUDE EPILINE_CYCLONEDDS_LIBRARY)
set(EPILINE_CYCLONEDDS_PACKAGE "" CACHE INTERNAL "")
set(version none)
if(EPILINE_CYCLONEDDS_INCLUDE AND EPILINE_CYCLONEDDS_LIBRARY)
  file(STRINGS ${EPILINE_CYCLONEDDS_INCLUDE}/dds/version.h version REGEX "define DDS_VERSION ")
endif()
if(version MATCHES "\"0\\.10\\.")  # what writes serialised messages differs between versions
  file(READ_SYMLINK ${EPILINE_CYCLONEDDS_LIBRARY} name)  # of the file that its package brings
  execute_process(COMMAND dpkg -S */${name} OUTPUT_VARIABLE package ERROR_QUIET)
  string(REGEX REPLACE ":.*" "" package "${package}")
  if(NOT package)
    set(package libddsc0debian)
  endif()
  set(EPILINE_CYCLONEDDS_PACKAGE ${package} CACHE INTERNAL "")
  add_library(epiline_cyclonedds INTERFACE)
  target_include_directories(epiline_cyclonedds SYSTEM INTERFACE ${EPILINE_CYCLONEDDS_INCLUDE})
  target_compile_definitions(epiline_cyclonedds INTERFACE EPILINE_CYCLONEDDS="${name}" EPILINE_CYCLONEDDS_PACKAGE="${package}")
else()
  message(STATUS "Built without odometry for ROS 2: no Cyclone DDS 0.10 (Debian: cyclonedds-dev)")
endif()
