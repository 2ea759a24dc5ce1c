# Finds an interpreter with NumPy, its headers and pybind11; says so where one is missing.
#
# Sets ricochet_python_found, ricochet_python_suffix (of a module), ricochet_numpy_include and
# the targets Python::Interpreter, Python::Module, pybind11::headers.
set(ricochet_python_found FALSE)

function(ricochet_has_numpy result candidate)
    execute_process(COMMAND ${candidate} -c "import numpy"
        RESULT_VARIABLE status OUTPUT_QUIET ERROR_QUIET)
    if(NOT status EQUAL 0)
        set(${result} FALSE PARENT_SCOPE)
    endif()
endfunction()

if(NOT Python_EXECUTABLE)
    find_program(RICOCHET_PYTHON_INTERPRETER NAMES python3 PATHS /usr/bin VALIDATOR ricochet_has_numpy
        DOC "Python with NumPy")
    if(RICOCHET_PYTHON_INTERPRETER)
        set(Python_EXECUTABLE ${RICOCHET_PYTHON_INTERPRETER})
    endif()
endif()
if(NOT Python_EXECUTABLE)
    message(STATUS "ricochet: no Python package, since no python3 with NumPy was found")
    return()
endif()
find_package(Python 3.9 COMPONENTS Interpreter Development.Module)
set(PYBIND11_NOPYTHON TRUE)
find_package(pybind11 2.10 CONFIG QUIET)
if(NOT Python_Development.Module_FOUND OR NOT pybind11_FOUND)
    message(STATUS "ricochet: no Python package, since the headers of Python or pybind11 were not found")
    return()
endif()
execute_process(
    COMMAND ${Python_EXECUTABLE} -c
        "import numpy, sysconfig; print(numpy.get_include()); print(sysconfig.get_config_var('EXT_SUFFIX')[1:])"
    OUTPUT_VARIABLE answer OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
string(REPLACE "\n" ";" answer "${answer}")
list(GET answer 0 ricochet_numpy_include)
list(GET answer 1 ricochet_python_suffix)
set(ricochet_python_found TRUE)
