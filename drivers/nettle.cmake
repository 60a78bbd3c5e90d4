# EPILINE_NETTLE_LIBRARY: SHA-256 of MAVLink's signatures, if Debian's nettle-dev is there.
find_path(EPILINE_NETTLE_INCLUDE nettle/sha2.h)
find_library(EPILINE_NETTLE_LIBRARY nettle)
mark_as_advanced(EPILINE_NETTLE_INCLUDE EPILINE_NETTLE_LIBRARY)
if(NOT EPILINE_NETTLE_INCLUDE OR NOT EPILINE_NETTLE_LIBRARY)
  message(STATUS "Built without MAVLink signing: no nettle (Debian: nettle-dev)")
endif()
