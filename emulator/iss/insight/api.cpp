// The C face of Insight: what profile.py calls.

#include "api.h"

#include "armv7m/system/system.h"
#include "insight/insight.h"

using insight::Insight;

extern "C" {

// Begins to look at a machine; `count` ranges of code.
Insight *insight_new(IssMachine *machine, const insight::CodeRange *ranges, int32_t count) {
    Insight *made = new Insight([](void *owner) { return iss_now((IssMachine *)owner); }, machine);
    for (int32_t n = 0; n < count && n < 2; n++)
        made->set_range(n, ranges[n]);
    iss_cpu(machine)->set_tracer(made);
    return made;
}

// Ends that; the counters are complete then. The machine may be gone: null.
void insight_delete(IssMachine *machine, Insight *made) {
    if (machine && iss_cpu(machine)->tracer == made)
        iss_cpu(machine)->set_tracer(nullptr);
    delete made;
}

// Whether changes are taken note of.
void insight_trace(Insight *made, int32_t on) { made->trace_changes(on != 0); }

// Ends open calls as of now.
void insight_finish(Insight *made) { made->finish(); }

// Copies the edges that there are to `out`, at most `most`; returns how many.
int32_t insight_edges(const Insight *made, insight::Edge *out, int32_t most) {
    int32_t found = 0;
    for (const insight::Edge &edge : made->edges)
        if (edge.count && found < most)
            out[found++] = edge;
    return found;
}

// Moves the changes so far to `out`, which has room for all of them; returns how many.
int32_t insight_changes(Insight *made, insight::Change *out) {
    const int32_t count = (int32_t)made->change_count;
    std::copy(made->changes, made->changes + count, out);
    made->change_count = 0;
    return count;
}

// Lowest stack pointers so far (main, process), cycles asleep, edges that there was no room for.
void insight_figures(const Insight *made, int64_t *out) {
    out[0] = made->lowest_sp[0], out[1] = made->lowest_sp[1];
    out[2] = made->idle, out[3] = (int64_t)made->edges_lost;
}

// The last fault: exception, CFSR, HFSR, DFSR, MMFAR, BFAR, address of the instruction, of the
// stacked frame (0: none), EXC_RETURN, number of faults since reset, and the cycle.
void insight_fault(IssMachine *machine, int64_t *out) {
    const armv7m::FaultRecord &fault = iss_system(machine)->last_fault();
    const int64_t values[] = {fault.exception, fault.cfsr, fault.hfsr, fault.dfsr,
                              fault.mmfar, fault.bfar, fault.pc, fault.frame,
                              fault.exc_return, fault.count, fault.cycle};
    std::copy(std::begin(values), std::end(values), out);
}

}  // extern "C"
