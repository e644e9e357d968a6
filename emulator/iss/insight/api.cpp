// The C interface of Insight, called by observer.py and fault_report.py.

#include "api.h"

#include "armv7m/system/system.h"
#include "insight/insight.h"

using insight::Insight;

extern "C" {

// Starts to observe a machine; `count`: number of code ranges.
Insight *insight_new(IssMachine *machine, const insight::CodeRange *ranges, int32_t count) {
    auto *observer = new Insight([](void *owner) { return iss_now((IssMachine *)owner); }, machine);
    for (int32_t n = 0; n < count && n < 2; n++)
        observer->set_range(n, ranges[n]);
    iss_cpu(machine)->set_tracer(observer);
    return observer;
}

// Ends the observation. `machine` is null if it no longer exists.
void insight_delete(IssMachine *machine, Insight *observer) {
    if (machine && iss_cpu(machine)->tracer == observer)
        iss_cpu(machine)->set_tracer(nullptr);
    delete observer;
}

// Whether changes are recorded.
void insight_trace(Insight *observer, int32_t on) { observer->trace_changes(on != 0); }

// Closes open calls.
void insight_finish(Insight *observer) { observer->finish(); }

// Copies at most `most` edges to `out`; returns their number.
int32_t insight_edges(const Insight *observer, insight::Edge *out, int32_t most) {
    int32_t found = 0;
    for (const insight::Edge &edge : observer->edges)
        if (edge.count && found < most)
            out[found++] = edge;
    return found;
}

// Moves all changes to `out`, which must have room for CHANGES; returns their number.
int32_t insight_changes(Insight *observer, insight::Change *out) {
    const int32_t count = (int32_t)observer->change_count;
    std::copy(observer->changes, observer->changes + count, out);
    observer->change_count = 0;
    return count;
}

// Lowest stack pointers (main, process), cycles asleep, number of edges lost.
void insight_figures(const Insight *observer, int64_t *out) {
    out[0] = observer->lowest_sp[0], out[1] = observer->lowest_sp[1];
    out[2] = observer->idle, out[3] = (int64_t)observer->edges_lost;
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
