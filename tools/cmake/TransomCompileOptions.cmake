# Compile options of our own targets: warnings, instruction set, floating point, sanitizers.
#
# Floating point. No -ffast-math: infinities and NaNs mean something here. No contraction into fused multiply-adds, so
# that the code gives the same answer for every instruction set. Two relaxations change no value: nobody reads errno
# after a mathematical function, and nobody traps floating-point exceptions.
include(CheckCXXSourceRuns)

function(transom_choose_arch result)
  if(NOT TRANSOM_ARCH STREQUAL "auto")
    set(${result} ${TRANSOM_ARCH} PARENT_SCOPE)
    return()
  endif()
  if(NOT CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    set(${result} "" PARENT_SCOPE)
    return()
  endif()
  check_cxx_source_runs("
    int main() {
      __builtin_cpu_init();
      const bool v3 = __builtin_cpu_supports(\"avx2\") && __builtin_cpu_supports(\"fma\") && __builtin_cpu_supports(\"bmi\") &&
                      __builtin_cpu_supports(\"bmi2\");
      return v3 ? 0 : 1;
    }" TRANSOM_PROCESSOR_RUNS_X86_64_V3)
  if(TRANSOM_PROCESSOR_RUNS_X86_64_V3)
    set(${result} "x86-64-v3" PARENT_SCOPE)
  else()
    set(${result} "x86-64-v2" PARENT_SCOPE)
  endif()
endfunction()

# Warnings are errors with the compiler that the project is tested with; another one may know warnings that we have
# not seen, which must not keep anybody from building.
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 12
   AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  set(werror_default ON)
else()
  set(werror_default OFF)
endif()
option(TRANSOM_WERROR "Treat warnings as errors (default: with GCC 12)" ${werror_default})

transom_choose_arch(transom_arch)
set(cxx_options -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual
    -ffp-contract=off -fno-math-errno -fno-trapping-math)
if(transom_arch)
  list(APPEND cxx_options -march=${transom_arch})
endif()
if(TRANSOM_WERROR)
  list(APPEND cxx_options -Werror)
endif()

add_library(transom_compile_options INTERFACE)
target_compile_options(transom_compile_options INTERFACE "$<$<COMPILE_LANGUAGE:CXX>:${cxx_options}>")
if(TRANSOM_SANITIZE)
  set(sanitize -fsanitize=${TRANSOM_SANITIZE} -fno-omit-frame-pointer)
  if(TRANSOM_SANITIZE MATCHES "undefined")
    list(APPEND sanitize -fno-sanitize-recover=all)
  endif()
  target_compile_options(transom_compile_options INTERFACE ${sanitize})
  target_link_options(transom_compile_options INTERFACE ${sanitize})
endif()
if(CMAKE_BUILD_TYPE STREQUAL "Release")
  set(CMAKE_CXX_FLAGS_RELEASE "-O3 -DNDEBUG")
endif()

# What transom._engine.build_description() says, after the version.
function(transom_describe_build result)
  set(text "${CMAKE_BUILD_TYPE} build, ${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION}")
  if(transom_arch)
    string(APPEND text ", ${transom_arch}")
  endif()
  if(TRANSOM_SANITIZE)
    string(APPEND text ", ${TRANSOM_SANITIZE} sanitizer")
  endif()
  set(${result} "${text}, Embree ${embree_VERSION}, oneTBB ${TBB_VERSION}" PARENT_SCOPE)
endfunction()
