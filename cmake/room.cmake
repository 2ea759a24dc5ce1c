# ricochet_room(<room> [TARGETS <libraries>] [FOLDERS <folders>] [FILES <headers>] [PACKAGE <package>])
#
# Installs the libraries of a room and its headers as one component with a file of targets of its
# own, and the licences for the Debian package. FOLDERS and FILES are relative to include/ricochet/;
# without both, the folder of the room's name is meant. Headers at former paths
# (cmake/old_paths.cmake) are installed with the room that has them now.
include(${CMAKE_CURRENT_LIST_DIR}/old_paths.cmake)

function(ricochet_room room)
    cmake_parse_arguments(PARSE_ARGV 1 arg "" "PACKAGE" "TARGETS;FOLDERS;FILES")
    if(NOT arg_FOLDERS AND NOT arg_FILES)
        set(arg_FOLDERS ${room})
    endif()
    if(NOT arg_PACKAGE)
        set(arg_PACKAGE libricochet-dev)
    endif()
    set(headers ${arg_FILES})
    list(TRANSFORM headers PREPEND include/ricochet/)
    foreach(folder IN LISTS arg_FOLDERS)
        file(GLOB_RECURSE found CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR}
            ${PROJECT_SOURCE_DIR}/include/ricochet/${folder}/*.hpp
            ${PROJECT_SOURCE_DIR}/include/ricochet/${folder}/*.inc)
        list(APPEND headers ${found})
    endforeach()
    list(REMOVE_ITEM headers
        ${ricochet_core_old_paths} ${ricochet_learn_steps_old_paths} ${ricochet_taylor_old_paths})
    foreach(header IN LISTS headers ricochet_${room}_old_paths)
        cmake_path(GET header PARENT_PATH folder)
        cmake_path(RELATIVE_PATH folder BASE_DIRECTORY include)
        install(FILES ${PROJECT_SOURCE_DIR}/${header}
            DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/${folder} COMPONENT ${room})
    endforeach()
    ricochet_licences(${arg_PACKAGE} ${room})
    if(arg_TARGETS)
        install(TARGETS ${arg_TARGETS} EXPORT ricochet-${room}-targets COMPONENT ${room})
        install(EXPORT ricochet-${room}-targets NAMESPACE ricochet::
            DESTINATION ${package_dir} COMPONENT ${room})
    endif()
endfunction()
