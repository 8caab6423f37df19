#include "f28_board.h"
#include "f28_run.h"
#include "f28_stack.h"

int main(void);

int main(void)
{
    volatile uint16_t top = 0U;

    f28_stack_paint(&top);
    f28_start();
    for (;;) {
        f28_pass();
    }
}
