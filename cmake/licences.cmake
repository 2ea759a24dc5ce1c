# The texts of the licences, where Debian looks for those of each package.
# ricochet_licences(<package> <component> [EXCLUDE_FROM_ALL])
function(ricochet_licences package component)
    set(directory ${CMAKE_INSTALL_DATAROOTDIR}/doc/${package})
    install(FILES ${PROJECT_SOURCE_DIR}/LICENSE
        DESTINATION ${directory} RENAME copyright COMPONENT ${component} ${ARGN})
    install(FILES ${PROJECT_SOURCE_DIR}/LICENSE-THIRD-PARTY
        DESTINATION ${directory} COMPONENT ${component} ${ARGN})
endfunction()
