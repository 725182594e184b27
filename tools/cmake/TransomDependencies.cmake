# The libraries that the engine needs, as imported targets. OSMesa and EGL are not among them: they are opened at run time.
set(transom_setup_hint "Run `make setup`, which installs what is missing, or `tools/setup.sh --print` to see the packages.")

foreach(package TBB glm Eigen3 Threads)
  find_package(${package} QUIET)
  if(NOT ${package}_FOUND)
    message(FATAL_ERROR "${package} was not found. ${transom_setup_hint}")
  endif()
endforeach()

# Embree 4 where there is one, else Embree 3. The headers lie in embree4/ or embree3/; engine code chooses by
# TRANSOM_EMBREE_MAJOR.
find_package(embree 4 QUIET)
if(NOT embree_FOUND)
  find_package(embree 3 QUIET)
endif()
if(NOT embree_FOUND)
  message(FATAL_ERROR "Embree 3 or 4 was not found. ${transom_setup_hint}")
endif()
add_library(transom_embree INTERFACE)
target_link_libraries(transom_embree INTERFACE embree)
string(REGEX MATCH "^[0-9]+" embree_major "${embree_VERSION}")
target_compile_definitions(transom_embree INTERFACE TRANSOM_EMBREE_MAJOR=${embree_major})

# nanobind comes from the Python that the module is built for: the project's own environment, unless told otherwise.
macro(transom_find_nanobind)
  if(NOT DEFINED Python_EXECUTABLE AND EXISTS ${PROJECT_SOURCE_DIR}/.venv/bin/python)
    set(Python_EXECUTABLE ${PROJECT_SOURCE_DIR}/.venv/bin/python)
  endif()
  find_package(Python 3.11 REQUIRED COMPONENTS Interpreter Development.Module)
  execute_process(
    COMMAND ${Python_EXECUTABLE} -m nanobind --cmake_dir
    OUTPUT_VARIABLE nanobind_ROOT OUTPUT_STRIP_TRAILING_WHITESPACE
    ERROR_QUIET RESULT_VARIABLE nanobind_status)
  if(NOT nanobind_status EQUAL 0)
    message(FATAL_ERROR "nanobind is not installed in ${Python_EXECUTABLE}. ${transom_setup_hint}")
  endif()
  find_package(nanobind CONFIG REQUIRED)
endmacro()
