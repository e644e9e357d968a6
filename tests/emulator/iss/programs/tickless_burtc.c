// The kernel of tickless.c on the backup counter.
#define ON_BURTC
#include "tickless.c"
