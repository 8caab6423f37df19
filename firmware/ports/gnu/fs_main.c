#include "fs_bare.h"

int main(void);

int main(void)
{
    fs_bare_start();
    for (;;) {
        fs_bare_pass();
    }
}
