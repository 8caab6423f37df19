/*
 * The firmware as a process: it speaks MAVLink on a pseudo-terminal whose name it prints, or on its standard streams.
 *
 *     fs_host            prints /dev/pts/N and serves it until the client closes it, or this program's input ends
 *     fs_host --stdio    serves standard input and output until the input ends
 *
 * Exits 0 when the other end has closed, 1 when the system refuses something, 2 for a wrong argument.
 */
#define _GNU_SOURCE /* ppoll */

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "fs_host.h"
#ifdef FS_SENSING /* with the estimator */
#include "fs_sensing.h"
#endif

#define PIECE 4096

/* Octets that the other end has not taken yet. */
typedef struct {
    unsigned char octets[PIECE];
    size_t first, end;
} pending;

/* The line, and the pipe of the parent process. */
typedef struct {
    int in, out;
    int slave;  /* held open until the client speaks, so that the line does not seem closed before; -1: not held */
    int parent; /* closed when the parent process ends; -1: no parent */
} line;

static int fail(const char *what)
{
    (void)fprintf(stderr, "fs_host: %s: %s\n", what, strerror(errno));
    return 1;
}

/* A terminal would echo, and change line ends. */
static int make_raw(int terminal)
{
    struct termios mode;

    if (tcgetattr(terminal, &mode) != 0) {
        return -1;
    }
    mode.c_iflag &= ~(tcflag_t)(IGNBRK | BRKINT | PARMRK | ISTRIP | INLCR | IGNCR | ICRNL | IXON);
    mode.c_oflag &= ~(tcflag_t)OPOST;
    mode.c_lflag &= ~(tcflag_t)(ECHO | ECHONL | ICANON | ISIG | IEXTEN);
    mode.c_cflag = (mode.c_cflag & ~(tcflag_t)(CSIZE | PARENB)) | CS8;
    return tcsetattr(terminal, TCSANOW, &mode);
}

static int open_terminal(line *ends)
{
    const int master = posix_openpt(O_RDWR | O_NOCTTY);
    const char *name;

    if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0) {
        return -1;
    }
    name = ptsname(master);
    ends->slave = (name != NULL) ? open(name, O_RDWR | O_NOCTTY) : -1;
    if (ends->slave < 0 || make_raw(ends->slave) != 0) {
        return -1;
    }
    ends->in = master;
    ends->out = master;
    ends->parent = STDIN_FILENO;
    (void)printf("%s\n", name);
    return fflush(stdout);
}

static int set_nonblocking(int file)
{
    const int flags = fcntl(file, F_GETFL);

    return (flags < 0) ? -1 : fcntl(file, F_SETFL, flags | O_NONBLOCK);
}

/* Send what the application has and the line takes; -1 when the line is closed. */
static int send_octets(const line *ends, fs_app *app, pending *waiting)
{
    for (;;) {
        ssize_t written;

        if (waiting->first == waiting->end) {
            waiting->first = 0;
            waiting->end = fs_host_app_transmit(app, waiting->octets, PIECE);
        }
        if (waiting->first == waiting->end) {
            return 0;
        }
        written = write(ends->out, &waiting->octets[waiting->first], waiting->end - waiting->first);
        if (written < 0) {
            return (errno == EAGAIN || errno == EINTR) ? 0 : -1;
        }
        waiting->first += (size_t)written;
    }
}

/* Give the application what has come; -1 when the line is closed. */
static int receive_octets(line *ends, fs_app *app)
{
    unsigned char octets[PIECE];
    const ssize_t count = read(ends->in, octets, sizeof octets);

    if (count < 0) {
        return (errno == EAGAIN || errno == EINTR) ? 0 : -1;
    }
    if (count > 0 && ends->slave >= 0) {
        (void)close(ends->slave); /* from now on the client's end alone keeps the line open */
        ends->slave = -1;
    }
    fs_host_app_receive(app, octets, (uint32_t)count);
    return (count > 0) ? 0 : -1;
}

/* Return for how long nothing is due. */
static struct timespec time_left(const fs_app *app)
{
    const uint32_t wait_ms = fs_app_wait_ms(app), run_us = fs_app_run_wait_us(app);
    struct timespec wait = {.tv_sec = (time_t)(wait_ms / 1000U), .tv_nsec = (long)(wait_ms % 1000U) * 1000000L};

    if (run_us / 1000U < wait_ms) {
        wait.tv_sec = (time_t)(run_us / 1000000U);
        wait.tv_nsec = (long)(run_us % 1000000U) * 1000L;
    }
    return wait;
}

/* Serve the line until its other end or the parent process is gone. */
static int serve(line *ends, fs_app *app)
{
    static pending waiting;
    const uint32_t began_ms = fs_host_milliseconds(), began_us = fs_host_microseconds();
    struct timespec wait;
    int is_open = 1;

    fs_app_poll(app, 0U);
    while (is_open) {
        struct pollfd watched[3] = {
            {.fd = ends->in, .events = POLLIN},
            {.fd = -1, .events = POLLOUT},
            {.fd = ends->parent, .events = 0}, /* only its end is of interest */
        };

        fs_app_run(app, fs_host_microseconds() - began_us);
        if (send_octets(ends, app, &waiting) != 0) {
            break;
        }
        watched[1].fd = (waiting.first != waiting.end) ? ends->out : -1;
        wait = time_left(app);
        if (ppoll(watched, 3, &wait, NULL) < 0 && errno != EINTR) {
            return fail("poll");
        }
        fs_app_run(app, fs_host_microseconds() - began_us); /* before the octets: their time is now */
        fs_app_poll(app, fs_host_milliseconds() - began_ms); /* octets received now came after the wait */
        if ((watched[0].revents & (POLLIN | POLLHUP | POLLERR)) != 0) {
            is_open = (receive_octets(ends, app) == 0);
        }
        if ((watched[2].revents & (POLLHUP | POLLERR)) != 0) {
            is_open = 0;
        }
    }
    (void)send_octets(ends, app, &waiting); /* a peer that closed only its sending side still gets the answers */
    return 0;
}

/* The port of this process: the host's, with the estimator if it is compiled in. */
static const fs_port *own_port(void)
{
    static fs_port port;

    port = *fs_host_port();
#ifdef FS_SENSING
    port.sense = fs_sensing_take;
    port.read_estimator = fs_sensing_read;
#endif
    return &port;
}

int main(int argc, char **argv)
{
    line ends = {.in = STDIN_FILENO, .out = STDOUT_FILENO, .slave = -1, .parent = -1};
    const int is_stdio = (argc == 2 && strcmp(argv[1], "--stdio") == 0);
    fs_app *app;
    int result;

    if (argc != 1 && !is_stdio) {
        (void)fprintf(stderr, "usage: fs_host [--stdio]\n");
        return 2;
    }
    (void)signal(SIGPIPE, SIG_IGN);
    if (!is_stdio && open_terminal(&ends) != 0) {
        return fail("pseudo-terminal");
    }
    if (set_nonblocking(ends.in) != 0 || set_nonblocking(ends.out) != 0) {
        return fail("line");
    }
    app = fs_host_app_new(own_port());
    if (app == NULL) {
        return fail("memory");
    }
    result = serve(&ends, app);
    fs_host_app_free(app);
    return result;
}
