# Toolchain file for TI's C2000 compiler (CGT 22.6 LTS):
# cmake --toolchain cmake/cl2000.cmake -DC2000_CGT_ROOT=/path/to/it
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR C28x)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)  # nothing can be linked without a linker command file
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES C2000_CGT_ROOT)

if(NOT C2000_CGT_ROOT)
  set(C2000_CGT_ROOT "$ENV{C2000_CGT_ROOT}")
endif()
find_program(C2000_CL NAMES cl2000 HINTS "${C2000_CGT_ROOT}/bin")
find_program(C2000_AR NAMES ar2000 HINTS "${C2000_CGT_ROOT}/bin")
if(NOT C2000_CL OR NOT C2000_AR)
  message(FATAL_ERROR "cl2000 not found: give -DC2000_CGT_ROOT=/path/to/ti-cgt-c2000, or set it in the environment")
endif()
get_filename_component(C2000_BIN "${C2000_CL}" DIRECTORY)
get_filename_component(C2000_CGT_ROOT "${C2000_BIN}" DIRECTORY)

set(CMAKE_C_COMPILER "${C2000_CL}")
set(CMAKE_ASM_COMPILER "${C2000_CL}")
set(CMAKE_AR "${C2000_AR}" CACHE FILEPATH "")

# One set for the compiler, the assembler and the linker's choice of the run-time library: EABI, FPU32, TMU0.
set(C2000_FLAGS "-v28 -ml -mt --abi=eabi --float_support=fpu32 --tmu_support=tmu0")
set(CMAKE_C_FLAGS_INIT "${C2000_FLAGS}")
set(CMAKE_ASM_FLAGS_INIT "${C2000_FLAGS}")
include_directories(SYSTEM "${C2000_CGT_ROOT}/include")
link_directories("${C2000_CGT_ROOT}/lib")
