# Peers that ricochet's monitor is used in, each only where it is found (Debian: libsundials-dev,
# libgsl-dev, libode-dev, libbullet-dev). They are for tests, examples and measurements; no library
# of ricochet is linked to them. Each is a target, `ricochet_peer_<name>`.

function(ricochet_peer name package header)
    cmake_parse_arguments(PARSE_ARGV 3 arg "" "" "LIBRARIES;SUFFIXES")
    find_path(RICOCHET_${name}_INCLUDE_DIR ${header} PATH_SUFFIXES ${arg_SUFFIXES})
    mark_as_advanced(RICOCHET_${name}_INCLUDE_DIR)
    set(found ${RICOCHET_${name}_INCLUDE_DIR})
    set(libraries "")
    foreach(library IN LISTS arg_LIBRARIES)
        find_library(RICOCHET_${library}_LIBRARY ${library})
        mark_as_advanced(RICOCHET_${library}_LIBRARY)
        list(APPEND libraries ${RICOCHET_${library}_LIBRARY})
        if(NOT RICOCHET_${library}_LIBRARY)
            set(found FALSE)
        endif()
    endforeach()
    if(NOT found)
        message(STATUS "no ${name}: its host is not built or tested (Debian: ${package})")
        return()
    endif()
    add_library(ricochet_peer_${name} INTERFACE)
    target_include_directories(ricochet_peer_${name} SYSTEM INTERFACE
        ${RICOCHET_${name}_INCLUDE_DIR})
    target_link_libraries(ricochet_peer_${name} INTERFACE ${libraries})
endfunction()

ricochet_peer(cvode libsundials-dev cvode/cvode.h LIBRARIES sundials_cvode sundials_nvecserial)
ricochet_peer(arkode libsundials-dev arkode/arkode.h LIBRARIES sundials_arkode sundials_nvecserial)
ricochet_peer(gsl libgsl-dev gsl/gsl_odeiv2.h LIBRARIES gsl gslcblas)
ricochet_peer(ode libode-dev ode/ode.h LIBRARIES ode)
ricochet_peer(bullet libbullet-dev btBulletDynamicsCommon.h
    LIBRARIES BulletDynamics BulletCollision LinearMath SUFFIXES bullet)
