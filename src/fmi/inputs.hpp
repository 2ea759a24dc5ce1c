// The inputs of a run as functions of time.
#pragma once

#include <vector>

#include "fmi/instance.hpp"

namespace ricochet::fmi {

class Inputs {
public:
    /// @throws Error or std::invalid_argument naming the input
    Inputs(const Description& description, const std::vector<Input>& given);

    [[nodiscard]] bool empty() const noexcept { return inputs_.empty(); }
    [[nodiscard]] bool gives(const Element& element) const noexcept;

    /// The first time [s] after t at which a table has a row; infinite if there is none.
    [[nodiscard]] double next_break(double t) const;
    /// Whether an input jumps at t, or a discrete one changes there.
    [[nodiscard]] bool jumps_at(double t) const;

    /// Sets the continuous inputs.
    /// @param after  at a jump: the values after it
    void set_continuous(Instance& instance, double t, bool after) const;
    /// Sets all inputs, for event mode, to their values from t on.
    void set_all(Instance& instance, double t) const;

private:
    struct One {
        Element element;
        bool discrete;
        Input table;

        [[nodiscard]] double at(double t, bool after) const;
    };

    std::vector<One> inputs_;
};

}  // namespace ricochet::fmi
