/* The mixture of CoreMark: a linked list that is searched, reversed and sorted, integer matrices, a
   state machine over text, and a CRC of all results. */

#include "load.inc"

enum { NODES = 60, SIZE = 9, TEXT = 400 };

struct node {
    struct node *next;
    int16_t key, index;
};

static uint16_t crc_16(uint32_t value, uint16_t crc) {
    for (int i = 0; i < 32; i++, value >>= 1) {
        const uint16_t bit = (uint16_t)((value ^ crc) & 1);
        crc = (uint16_t)(crc >> 1 ^ (bit ? 0xA001 : 0));
    }
    return crc;
}

static struct node *find(struct node *list, int16_t key) {
    while (list && list->key != key) list = list->next;
    return list;
}

static struct node *reverse(struct node *list) {
    struct node *done = 0;
    while (list) {
        struct node *const next = list->next;
        list->next = done, done = list, list = next;
    }
    return done;
}

static int by_key(const struct node *a, const struct node *b) { return a->key - b->key; }
static int by_index(const struct node *a, const struct node *b) { return a->index - b->index; }

static struct node *merge(struct node *a, struct node *b,
                          int (*order)(const struct node *, const struct node *)) {
    struct node *first = 0, **end = &first;
    while (a && b) {
        struct node **const taken = order(a, b) <= 0 ? &a : &b;
        *end = *taken, end = &(*taken)->next, *taken = *end;
    }
    *end = a ? a : b;
    return first;
}

static struct node *sort(struct node *list,
                         int (*order)(const struct node *, const struct node *)) {
    if (!list || !list->next) return list;
    struct node *middle = list, *end = list->next;
    while (end && end->next) middle = middle->next, end = end->next->next;
    struct node *const rest = middle->next;
    middle->next = 0;
    return merge(sort(list, order), sort(rest, order), order);
}

static uint16_t lists(uint32_t *seed, uint16_t crc) {
    static struct node nodes[NODES];
    for (int i = 0; i < NODES; i++) {
        nodes[i].next = i + 1 < NODES ? &nodes[i + 1] : 0;
        nodes[i].key = (int16_t)(draw(seed) & 0xFF), nodes[i].index = (int16_t)i;
    }
    struct node *list = nodes;
    for (int16_t key = 0; key < 40; key++) {
        const struct node *const found = find(list, key);
        if (found) crc = crc_16((uint32_t)found->index, crc);
        list = reverse(list);
    }
    list = sort(list, by_key);
    for (const struct node *at = list; at; at = at->next) crc = crc_16((uint16_t)at->key, crc);
    return crc_16((uint32_t)sort(list, by_index)->key, crc);
}

static uint16_t matrices(uint32_t *seed, uint16_t crc) {
    static int16_t a[SIZE][SIZE], b[SIZE][SIZE];
    static int32_t c[SIZE][SIZE];
    for (int i = 0; i < SIZE; i++)
        for (int k = 0; k < SIZE; k++)
            a[i][k] = (int16_t)(draw(seed) & 0x3FF), b[i][k] = (int16_t)(draw(seed) & 0x3FF);
    for (int i = 0; i < SIZE; i++)
        for (int k = 0; k < SIZE; k++) {
            int32_t sum = 0;
            for (int j = 0; j < SIZE; j++) sum += a[i][j] * b[j][k];
            c[i][k] = sum;
        }
    int32_t total = 0, last = 0;
    for (int i = 0; i < SIZE; i++)
        for (int k = 0; k < SIZE; k++) {
            const int32_t here = (c[i][k] >> 2 & 15) * (c[i][k] >> 5 & 127);
            total = total > 20000 ? 0 : total + (here > last ? 10 : here & 7);
            last = here;
        }
    return crc_16((uint32_t)total, crc_16((uint32_t)c[3][4], crc));
}

enum state { START, SIGN, INTEGER, POINT, FRACTION, EXPONENT, SCALE, INVALID, STATES };

static enum state number(const char **text) {
    enum state state = START;
    for (; **text && **text != ','; (*text)++) {
        const char c = **text;
        const int digit = c >= '0' && c <= '9';
        switch (state) {
        case START: state = digit ? INTEGER : c == '+' || c == '-' ? SIGN : c == '.' ? POINT : INVALID; break;
        case SIGN: state = digit ? INTEGER : c == '.' ? POINT : INVALID; break;
        case INTEGER: state = digit ? INTEGER : c == '.' ? POINT : c == 'e' ? EXPONENT : INVALID; break;
        case POINT: case FRACTION: state = digit ? FRACTION : c == 'e' ? EXPONENT : INVALID; break;
        case EXPONENT: state = digit || c == '-' || c == '+' ? SCALE : INVALID; break;
        case SCALE: state = digit ? SCALE : INVALID; break;
        default: break;
        }
    }
    if (**text) (*text)++;
    return state;
}

static uint16_t states(uint32_t *seed, uint16_t crc) {
    static char text[TEXT + 1];
    static const char letters[] = "0123456789012345+-.e,,,x";
    uint32_t counts[STATES] = {0};
    for (int i = 0; i < TEXT; i++) text[i] = letters[draw(seed) % (sizeof letters - 1)];
    for (const char *at = text; *at;) counts[number(&at)]++;
    for (int i = 0; i < STATES; i++) crc = crc_16(counts[i], crc);
    return crc;
}

uint32_t load(uint32_t seed, uint32_t rounds) {
    uint16_t crc = 0;
    for (uint32_t i = 0; i < rounds; i++) crc = states(&seed, matrices(&seed, lists(&seed, crc)));
    return crc;
}
