// Profile of a program: counts, calls, changes of function and stack use. It observes instructions
// and changes nothing. The C functions at the end are called by observer.py and fault_report.py.
//
// Calls are recognised by their instructions (BL, BLX), tail calls by a branch from one function
// into another, returns by address and stack pointer. An exception has no caller: its cycles do not
// count for the code that it interrupts. When an exception returns to another stack than it came
// from, the open calls of the old task are kept until it continues.
#include "api.h"

#include "armv7m/core/cpu.h"
#include "armv7m/system/system.h"

#include <algorithm>
#include <cstdint>

namespace insight {

// A memory that can hold code. Arrays have one element per half-word; the counters may be null.
struct CodeRange {
    uint32_t base, size;
    const uint8_t *host;
    uint64_t *cycles, *counts;
    const uint16_t *functions;  // 0: none
};

// Calls from `site` to `callee`; the site of an exception is EXCEPTION_SITE + its number.
struct Edge {
    uint32_t site, callee;
    uint64_t count, cycles;
};

// From `time` (ps) on the program was in `function` with `exception` active.
struct Change {
    int64_t time;
    uint16_t function, exception;
    uint32_t pc;
};

constexpr uint32_t EXCEPTION_SITE = 0xFFFFF000;

class Insight : public armv7m::Tracer {
public:
    static constexpr uint32_t EDGES = 1 << 14, CHANGES = 1 << 14;
    static constexpr int DEPTH = 1024, TASKS = 16, TASK_DEPTH = 64;
    // Longer gaps between two instructions, in cycles, are sleep.
    static constexpr int64_t LONGEST_WAIT = 64;

    explicit Insight(IssMachine *machine) : machine(machine) {}

    void instruction(uint32_t pc, uint32_t next, int64_t before, int64_t after,
                     armv7m::Cpu &cpu) override {
        if (returning) {  // cycles before this instruction belong to the return
            if (before - last <= LONGEST_WAIT) {
                charge(range_of(last_pc), last_pc, before - last, 0);
                last = before;
            }
            leave_exception(last);
        }
        const int64_t begin = wait_or_sleep(before);
        const CodeRange *range = range_of(pc);
        charge(range, pc, after - begin, 1);
        last = after, last_pc = pc;
        uint32_t &lowest = lowest_sp[cpu.process_stack_in_use()];
        if (cpu.r[13] < lowest)
            lowest = cpu.r[13];
        if (next != pc + 2 && next != pc + 4)
            jumped(range, pc, next, cpu);
        if (tracing)
            record(next, cpu);
    }

    // The cycles of the entry count for the first instruction.
    void exception_entry(int number, uint32_t returns_to, armv7m::Cpu &cpu) override {
        if (returning)
            leave_exception(last);
        last = wait_or_sleep(cpu.cycles);
        const bool from_process = (cpu.r[14] & 0xC) == 0xC;  // LR is EXC_RETURN
        push({returns_to, from_process ? cpu.process_sp() : 0, EXCEPTION_SITE + (uint32_t)number,
              cpu.r[15], last, stolen, true});
        if (tracing)
            record(cpu.r[15], cpu);
    }

    void exception_return(uint32_t exc_return, armv7m::Cpu &cpu) override {
        returning = true;
        resumed = exc_return & 4 ? cpu.process_sp() : 0;
    }

    // Closes all open calls; for the end of a profile.
    void finish() {
        while (depth)
            close(last);
    }

    CodeRange ranges[2] = {};
    bool tracing = false;  // whether changes are recorded
    Edge edges[EDGES] = {};
    uint32_t edge_count = 0;
    uint64_t edges_lost = 0;
    Change changes[CHANGES];
    uint32_t change_count = 0;
    int64_t idle = 0;
    uint32_t lowest_sp[2] = {UINT32_MAX, UINT32_MAX};  // of MSP and PSP while in use

private:
    struct Frame {
        uint32_t returns_to, sp, site, callee;
        int64_t start, stolen;
        bool exception;
    };
    struct Task {
        uint32_t sp = 0;
        int depth = 0;
        int64_t since = 0;
        Frame frames[TASK_DEPTH];
    };

    // The first cycle that counts for an instruction or exception at `cycles`: waits since the
    // previous one count, sleep does not.
    int64_t wait_or_sleep(int64_t cycles) {
        const int64_t gap = cycles - last;
        if (gap <= LONGEST_WAIT) return last;
        idle += gap;
        stolen += gap;
        return cycles;
    }

    static void charge(const CodeRange *range, uint32_t pc, int64_t cycles, uint64_t count) {
        if (!range || !range->cycles) return;
        const uint32_t index = (pc - range->base) >> 1;
        range->cycles[index] += (uint64_t)cycles;
        range->counts[index] += count;
    }

    void leave_exception(int64_t cycles) {
        returning = false;
        while (depth && !frames[depth - 1].exception)
            close(cycles);
        if (!depth) return;
        const Frame &marker = frames[depth - 1];
        const int64_t own = cycles - marker.start - (stolen - marker.stolen);
        const uint32_t stack = marker.sp;
        close(cycles);
        stolen += own;
        if (stack != resumed)
            switch_task(stack, resumed, cycles);
    }

    const CodeRange *range_of(uint32_t pc) const {
        for (const CodeRange &range : ranges)
            if (pc - range.base < range.size) return &range;
        return nullptr;
    }

    uint16_t function_at(uint32_t pc) const {
        const CodeRange *range = range_of(pc);
        return range && range->functions ? range->functions[(pc - range->base) >> 1] : 0;
    }

    void jumped(const CodeRange *range, uint32_t pc, uint32_t next, const armv7m::Cpu &cpu) {
        const uint32_t sp = cpu.r[13];
        const uint32_t length = call_length(range, pc);
        if (length) {
            push({pc + length, sp, pc, next, cpu.cycles, stolen, false});
            return;
        }
        // Frames above the stack pointer were left, for example by longjmp.
        while (depth && !frames[depth - 1].exception && frames[depth - 1].sp < sp)
            close(cpu.cycles);
        bool returned = false;
        while (depth && !frames[depth - 1].exception && frames[depth - 1].sp == sp &&
               frames[depth - 1].returns_to == next) {
            close(cpu.cycles);
            returned = true;
        }
        if (returned || !depth || frames[depth - 1].exception) return;
        const uint16_t from = function_at(pc), to = function_at(next);
        if (from != to && from && to)
            push({frames[depth - 1].returns_to, frames[depth - 1].sp, pc, next, cpu.cycles, stolen,
                  false});
    }

    // Length in bytes of the call at `pc`; 0: no call. ARMv7-M, A7.7.18 and A7.7.19.
    static uint32_t call_length(const CodeRange *range, uint32_t pc) {
        if (!range || pc - range->base + 4 > range->size) return 0;
        const uint8_t *code = range->host + (pc - range->base);
        const uint32_t first = code[0] | (uint32_t)code[1] << 8;
        const uint32_t second = code[2] | (uint32_t)code[3] << 8;
        if ((first & 0xFF87) == 0x4780) return 2;
        return (first & 0xF800) == 0xF000 && (second & 0xD000) == 0xD000 ? 4 : 0;
    }

    // An endless recursion drops its oldest calls.
    void push(const Frame &frame) {
        if (depth == DEPTH)
            depth = 0;
        frames[depth++] = frame;
    }

    void close(int64_t cycles) {
        const Frame &frame = frames[--depth];
        const uint32_t mask = EDGES - 1;
        uint32_t at = (frame.site * 2654435761u ^ frame.callee * 40503u) & mask;
        while (edges[at].count &&
               (edges[at].site != frame.site || edges[at].callee != frame.callee))
            at = (at + 1) & mask;
        if (!edges[at].count) {
            if (edge_count >= EDGES * 3 / 4) {
                edges_lost++;
                return;
            }
            edge_count++;
            edges[at] = {frame.site, frame.callee, 0, 0};
        }
        edges[at].count++;
        edges[at].cycles += (uint64_t)(cycles - frame.start - (stolen - frame.stolen));
    }

    // The calls above the last marker belong to the task whose stack pointer was `from`.
    void switch_task(uint32_t from, uint32_t to, int64_t cycles) {
        int first = depth;
        while (first && !frames[first - 1].exception)
            first--;
        Task *free = nullptr, *wanted = nullptr;
        for (Task &task : tasks) {
            if (task.depth && task.sp == to)
                wanted = &task;
            else if (!task.depth && !free)
                free = &task;
        }
        if (free && depth - first <= TASK_DEPTH) {
            free->sp = from, free->depth = depth - first, free->since = cycles - stolen;
            std::copy(frames + first, frames + depth, free->frames);
        }
        depth = first;
        if (wanted) {
            const int64_t away = cycles - stolen - wanted->since;
            for (int n = 0; n < wanted->depth; n++) {
                frames[depth] = wanted->frames[n];
                frames[depth++].start += away;
            }
            wanted->depth = 0;
        }
    }

    void record(uint32_t pc, armv7m::Cpu &cpu) {
        const uint16_t function = function_at(pc);
        if (function == recorded && cpu.ipsr == recorded_exception) return;
        recorded = function, recorded_exception = cpu.ipsr;
        changes[change_count++] = {iss_now(machine), function, cpu.ipsr, pc};
        if (change_count + 2 >= CHANGES)
            cpu.stop();
        if (change_count == CHANGES)
            change_count--;
    }

    IssMachine *const machine;
    Frame frames[DEPTH];
    Task tasks[TASKS];
    int depth = 0;
    int64_t last = 0, stolen = 0;
    bool returning = false;
    uint32_t last_pc = 0;
    uint32_t resumed = 0;  // process stack pointer to which an exception returns; 0: main stack
    uint16_t recorded = 0xFFFF, recorded_exception = 0xFFFF;
};

}  // namespace insight

using insight::Insight;

extern "C" {

// Starts to observe a machine; `count`: number of code ranges, at most 2.
Insight *insight_new(IssMachine *machine, const insight::CodeRange *ranges, int32_t count) {
    auto *observer = new Insight(machine);
    std::copy(ranges, ranges + count, observer->ranges);
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
void insight_trace(Insight *observer, int32_t on) { observer->tracing = on; }

// Closes open calls.
void insight_finish(Insight *observer) { observer->finish(); }

// Copies the edges to `out`, which must have room for EDGES; returns their number.
int32_t insight_edges(const Insight *observer, insight::Edge *out) {
    const auto used = [](const insight::Edge &edge) { return edge.count != 0; };
    const auto &all = observer->edges;
    return (int32_t)(std::copy_if(std::begin(all), std::end(all), out, used) - out);
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

void insight_fault(IssMachine *machine, armv7m::FaultRecord *out) {
    *out = iss_system(machine)->last_fault();
}

}  // extern "C"
