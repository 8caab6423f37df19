/* The floor of real time: absolute sleeps at a fixed period and nothing else. Prints one lateness [ns] a line.
   Arguments: period [ns], number of periods, timer slack [ns]. */
#define _GNU_SOURCE
#include <stdio.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <time.h>

static long long now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

int main(int argc, char **argv)
{
    if (argc != 4)
        return 2;
    long long period = atoll(argv[1]);
    long count = atol(argv[2]);
    long long *late = malloc(sizeof *late * (size_t)count);
    if (!late)
        return 1;
    prctl(PR_SET_TIMERSLACK, strtoul(argv[3], NULL, 10), 0, 0, 0);
    long long deadline = now_ns();
    for (long i = 0; i < count; i++) {
        deadline += period;
        struct timespec t = {deadline / 1000000000LL, deadline % 1000000000LL};
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) != 0)
            ;
        late[i] = now_ns() - deadline;
        if (late[i] >= period) /* skip what has passed, as the flight stack does */
            deadline += late[i] / period * period;
    }
    for (long i = 0; i < count; i++)
        printf("%lld\n", late[i]);
    return 0;
}
