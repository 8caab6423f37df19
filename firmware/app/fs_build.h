/* What a build says about itself. */
#ifndef FS_BUILD_H
#define FS_BUILD_H

/* First 8 octets of the SHA-256 of the sources, given to the compiler: -DFS_SOURCE_HASH=0x12U,0x34U,... */
#ifndef FS_SOURCE_HASH
#define FS_SOURCE_HASH 0U, 0U, 0U, 0U, 0U, 0U, 0U, 0U
#endif

#define FS_TEXT_OF(number) #number
#define FS_TEXT(number) FS_TEXT_OF(number)

/* 47 characters of it are sent; a build may replace it: -DFS_COMPILER="..." */
#if defined(FS_COMPILER)
/* given */
#elif defined(__TI_COMPILER_VERSION__)
#define FS_COMPILER "cl2000 " FS_TEXT(__TI_COMPILER_VERSION__)
#elif defined(__clang__)
#define FS_COMPILER "clang " __clang_version__
#elif defined(__GNUC__)
#define FS_COMPILER "gcc " __VERSION__
#else
#define FS_COMPILER "unknown"
#endif

#endif
