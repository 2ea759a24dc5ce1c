# Finds an interpreter with NumPy, its headers and pybind11; says so where one is missing.
#
# Sets ricochet_python_found, ricochet_python_suffix (of a module), ricochet_numpy_include and
# the targets Python::Interpreter, Python::Module, pybind11::headers. With
# RICOCHET_PYTHON_REQUIRED what is missing is an error.
set(ricochet_python_found FALSE)

function(ricochet_has_numpy result candidate)
    execute_process(COMMAND ${candidate} -c "import numpy"
        RESULT_VARIABLE status OUTPUT_QUIET ERROR_QUIET)
    if(NOT status EQUAL 0)
        set(${result} FALSE PARENT_SCOPE)
    endif()
endfunction()

function(ricochet_no_python why)
    if(RICOCHET_PYTHON_REQUIRED)
        message(FATAL_ERROR "ricochet: no Python package, since ${why}")
    endif()
    message(STATUS "ricochet: no Python package, since ${why}")
endfunction()

if(NOT Python_EXECUTABLE)
    find_program(RICOCHET_PYTHON_INTERPRETER NAMES python3 PATHS /usr/bin VALIDATOR ricochet_has_numpy
        DOC "Python with NumPy")
    if(RICOCHET_PYTHON_INTERPRETER)
        set(Python_EXECUTABLE ${RICOCHET_PYTHON_INTERPRETER})
    endif()
endif()
if(NOT Python_EXECUTABLE)
    ricochet_no_python("no python3 with NumPy was found")
    return()
endif()
find_package(Python 3.9 COMPONENTS Interpreter Development.Module)
if(NOT Python_Development.Module_FOUND)
    ricochet_no_python("the headers of ${Python_EXECUTABLE} were not found")
    return()
endif()
execute_process(
    COMMAND ${Python_EXECUTABLE} -c
        "import numpy, sysconfig; print(numpy.__version__); print(numpy.get_include()); print(sysconfig.get_config_var('EXT_SUFFIX')[1:])"
    RESULT_VARIABLE status OUTPUT_VARIABLE answer OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
if(NOT status EQUAL 0)
    ricochet_no_python("${Python_EXECUTABLE} has no NumPy")
    return()
endif()
string(REPLACE "\n" ";" answer "${answer}")
list(GET answer 0 ricochet_numpy_version)
list(GET answer 1 ricochet_numpy_include)
list(GET answer 2 ricochet_python_suffix)

# The pybind11 that pip has installed for this interpreter comes before that of the system, which
# may be older than the interpreter's NumPy. Layouts of NumPy 2 are known to pybind11 from 2.12 on.
set(ricochet_pybind11_least 2.10)
if(ricochet_numpy_version VERSION_GREATER_EQUAL 2)
    set(ricochet_pybind11_least 2.12)
endif()
execute_process(COMMAND ${Python_EXECUTABLE} -m pybind11 --cmakedir
    OUTPUT_VARIABLE ricochet_pybind11_hint OUTPUT_STRIP_TRAILING_WHITESPACE
    ERROR_QUIET)
set(PYBIND11_NOPYTHON TRUE)
find_package(pybind11 ${ricochet_pybind11_least} CONFIG QUIET HINTS "${ricochet_pybind11_hint}")
if(NOT pybind11_FOUND)
    list(REMOVE_DUPLICATES pybind11_CONSIDERED_VERSIONS)
    list(JOIN pybind11_CONSIDERED_VERSIONS ", " considered)
    if(NOT considered)
        set(considered none)
    endif()
    ricochet_no_python("NumPy ${ricochet_numpy_version} of ${Python_EXECUTABLE} needs pybind11 ${ricochet_pybind11_least} or later, found: ${considered}; 'pip install pybind11' installs the newest")
    return()
endif()
message(STATUS "ricochet: Python package by ${Python_EXECUTABLE}, NumPy ${ricochet_numpy_version}, pybind11 ${pybind11_VERSION}")
set(ricochet_python_found TRUE)
