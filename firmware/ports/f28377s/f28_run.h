/* The firmware on the LaunchPad: start it once, then pass after pass of its main loop. */
#ifndef F28_RUN_H
#define F28_RUN_H

void f28_start(void);
void f28_pass(void);

#endif
