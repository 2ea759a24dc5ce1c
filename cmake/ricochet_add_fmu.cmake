# ricochet_add_fmu(<target> SOURCES <files> [VERSIONS 2 3] [INTERFACES me cs] [LINK <libraries>]
#                  [OUTPUT_DIRECTORY <folder>])
#
# Builds a library from sources of which one has RICOCHET_FMU(Model), asks it for its description,
# and packs <target>.fmu of FMI 3.0 and <target>-2.fmu of FMI 2.0, by default both, for model
# exchange and co-simulation. The library needs nothing beyond libc and libm, and has the functions
# of FMI alone.
function(ricochet_add_fmu target)
    cmake_parse_arguments(PARSE_ARGV 1 arg "" "OUTPUT_DIRECTORY" "SOURCES;VERSIONS;INTERFACES;LINK")
    if(NOT arg_SOURCES)
        message(FATAL_ERROR "ricochet_add_fmu(${target}): found no SOURCES; expected one with RICOCHET_FMU")
    endif()
    if(arg_UNPARSED_ARGUMENTS)
        message(FATAL_ERROR "ricochet_add_fmu(${target}): found '${arg_UNPARSED_ARGUMENTS}'; expected SOURCES, VERSIONS, INTERFACES, LINK or OUTPUT_DIRECTORY")
    endif()
    if(NOT arg_VERSIONS)
        set(arg_VERSIONS 2 3)
    endif()
    if(NOT arg_INTERFACES)
        set(arg_INTERFACES me cs)
    endif()
    if(NOT arg_OUTPUT_DIRECTORY)
        set(arg_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR})
    endif()
    set(me false)
    set(cs false)
    foreach(interface IN LISTS arg_INTERFACES)
        if(NOT interface MATCHES "^(me|cs)$")
            message(FATAL_ERROR "ricochet_add_fmu(${target}): found the interface '${interface}'; expected me or cs")
        endif()
        set(${interface} true)
    endforeach()
    add_library(${target} MODULE ${arg_SOURCES})
    set_target_properties(${target} PROPERTIES PREFIX "" SUFFIX .so
        POSITION_INDEPENDENT_CODE ON CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
    target_compile_definitions(${target} PRIVATE
        RICOCHET_FMU_IDENTIFIER="${target}"
        RICOCHET_FMU_MODEL_EXCHANGE=${me}
        RICOCHET_FMU_CO_SIMULATION=${cs})
    target_link_libraries(${target} PRIVATE
        "$<LINK_LIBRARY:WHOLE_ARCHIVE,ricochet::fmi_export>" ${arg_LINK} ricochet::ricochet)
    ricochet_fmu_link_options(${target})
    set(platform2 linux64)
    set(platform3 ${CMAKE_SYSTEM_PROCESSOR}-linux)
    set(ending2 -2)
    set(ending3 "")
    foreach(version IN LISTS arg_VERSIONS)
        if(NOT version MATCHES "^[23]$")
            message(FATAL_ERROR "ricochet_add_fmu(${target}): found the version '${version}'; expected 2 or 3")
        endif()
        set(folder ${CMAKE_CURRENT_BINARY_DIR}/${target}.dir/fmi${version})
        set(binaries ${folder}/binaries/${platform${version}})
        add_custom_command(TARGET ${target} POST_BUILD
            COMMAND ${CMAKE_COMMAND} -E rm -rf ${folder}
            COMMAND ${CMAKE_COMMAND} -E make_directory ${binaries}
            COMMAND ricochet::fmu_describe $<TARGET_FILE:${target}> ${version} ${folder}/modelDescription.xml
            COMMAND ${CMAKE_COMMAND} -E copy $<TARGET_FILE:${target}> ${binaries}/
            COMMAND ${CMAKE_COMMAND} -E chdir ${folder} ${CMAKE_COMMAND} -E tar cf
                ${arg_OUTPUT_DIRECTORY}/${target}${ending${version}}.fmu --format=zip
                modelDescription.xml binaries
            VERBATIM)
    endforeach()
endfunction()

function(ricochet_fmu_link_options target)
    file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/${target}.map
        "{ global: fmi2*; fmi3*; ricochet_fmu_description*; local: *; };\n")
    target_link_options(${target} PRIVATE -static-libstdc++ -static-libgcc
        LINKER:--as-needed LINKER:--no-undefined LINKER:--gc-sections LINKER:--strip-all
        LINKER:--version-script=${CMAKE_CURRENT_BINARY_DIR}/${target}.map)
endfunction()
