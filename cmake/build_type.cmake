# A message where no build type is chosen, since the compiler then optimises nothing.
get_property(ricochet_multi_config GLOBAL PROPERTY GENERATOR_IS_MULTI_CONFIG)
if(NOT CMAKE_BUILD_TYPE AND NOT ricochet_multi_config AND NOT CMAKE_CXX_FLAGS MATCHES "-O")
    message(STATUS "ricochet: CMAKE_BUILD_TYPE is empty, so that nothing is optimised and runs take many times as long; expected -DCMAKE_BUILD_TYPE=Release")
endif()
