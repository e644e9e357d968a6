// A bridged design as CXXRTL's C++ has it, before synthesis. See settled.h for why eval() is called
// twice before each commit: the design's clocks come out of the bridge's registers.

#pragma once

#include "design.cpp"

struct Board {
    bool rx = true, tx = true;

    Board() {
        top.p_rx.set<bool>(true);
        settle();
    }

    bool clock() {
        top.p_rx.set<bool>(rx);
        top.p_clk.set<bool>(true);
        const bool changed = settle();
        top.p_clk.set<bool>(false);
        settle();
        tx = top.p_tx.get<bool>();
        return changed;
    }

private:
    cxxrtl_design::p_top top;

    bool settle() {
        bool changed = false;
        do {
            top.eval();
            top.eval();
        } while (top.commit() && (changed = true));
        return changed;
    }
};
