# For a wheel (RICOCHET_WHEEL): what it is built from are headers, of the system or of the build
# requirements in pyproject.toml, and it is small.
#
# ricochet_headers_alone(<target> <header>): an imported target with the folder of the header.
function(ricochet_headers_alone target header)
    string(MAKE_C_IDENTIFIER ${target} name)
    find_path(RICOCHET_${name}_INCLUDE_DIR ${header})
    mark_as_advanced(RICOCHET_${name}_INCLUDE_DIR)
    if(NOT RICOCHET_${name}_INCLUDE_DIR)
        message(FATAL_ERROR "ricochet: found no ${header}, expected it in the system or in CMAKE_INCLUDE_PATH")
    endif()
    message(STATUS "ricochet: ${header} of ${RICOCHET_${name}_INCLUDE_DIR}")
    add_library(${target} INTERFACE IMPORTED GLOBAL)
    target_include_directories(${target} INTERFACE ${RICOCHET_${name}_INCLUDE_DIR})
endfunction()

ricochet_headers_alone(nlohmann_json::nlohmann_json nlohmann/json.hpp)
ricochet_headers_alone(fmt::fmt fmt/format.h)
target_compile_definitions(fmt::fmt INTERFACE FMT_HEADER_ONLY=1)  # so that no library of it is needed

# Products of AArch64 have the bits of x86-64, whose baseline has no fused multiply-add.
add_compile_options(-ffp-contract=off)
set(CMAKE_CXX_FLAGS_RELEASE "-O2 -DNDEBUG")
if(CMAKE_SYSTEM_NAME STREQUAL Linux)
    add_compile_options(-ffunction-sections -fdata-sections)
    add_link_options(LINKER:--gc-sections LINKER:--as-needed LINKER:-s)
endif()

# Compiles small what calls the user's functions far more often than it computes, or is not hot at
# all; the loop, its kernels, networks and scenes are compiled fast. Headers that are compiled
# before would bring their own level with them.
function(ricochet_small_parts)
    foreach(target IN ITEMS ricochet_nonsmooth ricochet_fixed_sizes ricochet_scene_contact
            ricochet_python_conversions)
        if(TARGET ${target})
            target_compile_options(${target} PRIVATE -Os)
            set_target_properties(${target} PROPERTIES DISABLE_PRECOMPILE_HEADERS ON)
        endif()
    endforeach()
endfunction()
cmake_language(DEFER CALL ricochet_small_parts)

# The same for sources of other libraries that read, describe and set up.
function(ricochet_small_sources)
    set(ricochet_scene_small chains.cpp explain.cpp json.cpp measure.cpp scene.cpp sides.cpp simulate.cpp world.cpp)
    set(ricochet_small
        bouncing_ball.cpp buck_converter.cpp coulomb_oscillator.cpp impact_oscillator.cpp outcome.cpp pendulum.cpp
        model_metadata.cpp safetensors.cpp self_test.cpp snapshot.cpp stick_slip.cpp thermostat.cpp)
    set(ricochet_python_small callbacks.cpp ensemble.cpp filippov.cpp gates.cpp implicit.cpp machine_code.cpp numbers.cpp)
    foreach(target IN ITEMS ricochet ricochet_scene ricochet_python)
        if(NOT TARGET ${target})
            continue()
        endif()
        get_target_property(sources ${target} SOURCES)
        get_target_property(folder ${target} SOURCE_DIR)
        foreach(source IN LISTS sources)
            cmake_path(GET source FILENAME name)
            if(name IN_LIST ${target}_small)
                cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${folder})
                set_source_files_properties(${source} TARGET_DIRECTORY ${target} PROPERTIES
                    COMPILE_OPTIONS -Os SKIP_UNITY_BUILD_INCLUSION ON SKIP_PRECOMPILE_HEADERS ON)
            endif()
        endforeach()
    endforeach()
endfunction()
cmake_language(DEFER CALL ricochet_small_sources)
