/* Recursion: an unbalanced tree, queens on a board, linear equations in integers, and a reader of
   nested expressions. */

#include "load.inc"

enum { NODES = 64, QUEENS = 6, SIZE = 6 };

struct node {
    struct node *left, *right;
    uint32_t key;
};

static struct node nodes[NODES];

static struct node *insert(struct node *tree, struct node *added) {
    if (!tree) return added;
    if (added->key < tree->key) tree->left = insert(tree->left, added);
    else tree->right = insert(tree->right, added);
    return tree;
}

static uint32_t walk(const struct node *tree, uint32_t depth) {
    if (!tree) return depth;
    return walk(tree->left, depth + 1) * 3 + (tree->key & 0xFF) + walk(tree->right, depth + 1);
}

static uint32_t place(uint32_t row, uint32_t columns, uint32_t rising, uint32_t falling) {
    if (row == QUEENS) return 1;
    uint32_t count = 0;
    for (uint32_t at = 0; at < QUEENS; at++) {
        const uint32_t bit = 1u << at, up = 1u << (row + at), down = 1u << (row + QUEENS - at);
        if (columns & bit || rising & up || falling & down) continue;
        count += place(row + 1, columns | bit, rising | up, falling | down);
    }
    return count;
}

static int32_t solve(uint32_t *seed) {    /* x with A x = b by elimination, scaled by 2^8 */
    int32_t a[SIZE][SIZE + 1], x[SIZE], sum = 0;
    for (int i = 0; i < SIZE; i++)
        for (int k = 0; k <= SIZE; k++)
            a[i][k] = (int32_t)(draw(seed) & 0x3F) + (i == k ? 400 : 0);
    for (int i = 0; i < SIZE; i++)
        for (int k = i + 1; k < SIZE; k++) {
            const int32_t factor = a[k][i] * 256 / a[i][i];
            for (int n = i; n <= SIZE; n++) a[k][n] -= factor * a[i][n] / 256;
        }
    for (int i = SIZE - 1; i >= 0; i--) {
        int32_t rest = a[i][SIZE] * 256;
        for (int k = i + 1; k < SIZE; k++) rest -= a[i][k] * x[k];
        x[i] = rest / a[i][i], sum += x[i];
    }
    return sum;
}

static const char *at;

static int32_t expression(void) {    /* sum { ("+" | "-") product }, product { "*" factor } */
    int32_t total = 0, term = 1, sign = 1;
    for (;;) {
        int32_t value = 0;
        if (*at == '(') {
            at++, value = expression();
            if (*at == ')') at++;
        } else {
            while (*at >= '0' && *at <= '9') value = value * 10 + (*at++ - '0');
        }
        term *= value;
        switch (*at) {
        case '*': at++; break;
        case '+': case '-': total += sign * term, term = 1, sign = *at++ == '+' ? 1 : -1; break;
        default: return total + sign * term;
        }
    }
}

uint32_t load(uint32_t seed, uint32_t rounds) {
    static const char text[] = "12*(3+4*(5-2))-(7+(8*(9-3)+1))*2+((((15))))-6*7";
    uint32_t sum = 0;
    for (uint32_t round = 0; round < rounds; round++) {
        struct node *tree = 0;
        for (int i = 0; i < NODES; i++) {
            nodes[i].left = nodes[i].right = 0, nodes[i].key = draw(&seed);
            tree = insert(tree, &nodes[i]);
        }
        at = text;
        sum = mix(mix(sum, walk(tree, 0)), (uint32_t)expression());
        sum = mix(mix(sum, place(0, 0, 0, 0)), (uint32_t)solve(&seed));
    }
    return sum;
}
