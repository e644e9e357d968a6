/* qsort, bsearch, own sorts, and a heap of nodes. */
#include "report.h"
#include <stdlib.h>

struct item { uint8_t tag; double key; char name[7]; int16_t number; };

static int by_key(const void *a, const void *b) {
    const double x = ((const struct item *)a)->key, y = ((const struct item *)b)->key;
    return (x > y) - (x < y);
}
static int by_name(const void *a, const void *b) {
    return strcmp(((const struct item *)a)->name, ((const struct item *)b)->name);
}
static int by_value(const void *a, const void *b) {
    return (*(const int32_t *)a > *(const int32_t *)b) - (*(const int32_t *)a < *(const int32_t *)b);
}
static void heap_sort(int16_t *a, int n) {
    for (int start = n / 2 - 1, end = n; end > 1;) {
        int root = start >= 0 ? start-- : 0;
        if (root == 0 && start < -1) { end--; const int16_t t = a[0]; a[0] = a[end], a[end] = t; }
        if (start == -1) start = -2;
        for (int child; (child = 2 * root + 1) < end; root = child) {
            if (child + 1 < end && a[child] < a[child + 1]) child++;
            if (a[root] >= a[child]) break;
            const int16_t t = a[root]; a[root] = a[child], a[child] = t;
        }
    }
}
struct node { struct node *left, *right; uint32_t value; };
static struct node *insert(struct node *tree, uint32_t value) {
    if (!tree) { tree = calloc(1, sizeof *tree); tree->value = value; return tree; }
    if (value < tree->value) tree->left = insert(tree->left, value);
    else tree->right = insert(tree->right, value);
    return tree;
}
static void walk(struct node *tree) {
    if (!tree) return;
    walk(tree->left), note(tree->value), walk(tree->right);
    free(tree);
}

int main(void) {
    static struct item items[60];
    static int32_t values[300];
    static int16_t shorts[200];
    for (int i = 0; i < 60; i++) {
        items[i].tag = (uint8_t)i, items[i].number = (int16_t)draw();
        items[i].key = (double)(int32_t)draw() / 7;
        for (int k = 0; k < 6; k++) items[i].name[k] = (char)('a' + draw() % 26);
    }
    qsort(items, 60, sizeof *items, by_key);
    for (int i = 0; i < 60; i++) note(items[i].tag), note((uint32_t)items[i].number);
    qsort(items, 60, sizeof *items, by_name);
    for (int i = 0; i < 60; i++) note(items[i].tag);
    for (int i = 0; i < 300; i++) values[i] = (int32_t)draw();
    qsort(values, 300, sizeof *values, by_value);
    for (int i = 0; i < 300; i++) {
        const int32_t *found = bsearch(&values[i], values, 300, sizeof *values, by_value);
        note((uint32_t)(found - values));
    }
    for (int i = 0; i < 200; i++) shorts[i] = (int16_t)draw();
    heap_sort(shorts, 200);
    for (int i = 0; i < 200; i++) note((uint32_t)shorts[i]);
    struct node *tree = NULL;
    for (int i = 0; i < 150; i++) tree = insert(tree, draw());
    walk(tree);
    return report("sorting");
}
