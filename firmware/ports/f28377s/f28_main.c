#include "f28_run.h"
#include "f28_stack.h"

int main(void);

int main(void)
{
    f28_stack_paint();
    f28_start();
    for (;;) {
        f28_pass();
    }
}
