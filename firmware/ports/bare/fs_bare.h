/* The firmware without an operating system: start it once, then pass after pass of its main loop. */
#ifndef FS_BARE_H
#define FS_BARE_H

void fs_bare_start(void);
void fs_bare_pass(void);

#endif
