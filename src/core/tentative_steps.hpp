// Starts of the steps that have been taken, but not yet closed by a check.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "ricochet/detail/step_state.hpp"

namespace ricochet::detail {

/// State that is needed to repeat a step.
template <class X>
struct TentativeStep {
    StepStart<X> start;
    double h_next = 0;  ///< [s] proposed length of the step
    double last_h = 0;  ///< [s] length of the step before it
    std::size_t samples = 0;
    std::size_t pieces = 0;
    std::uint64_t rejected = 0;
    X beyond{};             ///< what its polynomial may differ from its cubic by
    bool is_cubic = false;  ///< by nothing
    bool is_known = false;  ///< it has a polynomial
};

/// An interval of tentative steps, in memory that is allocated once.
template <class X>
class TentativeSteps {
public:
    TentativeSteps(std::size_t most, const X& like) : steps_(most)
    {
        for (TentativeStep<X>& step : steps_) {
            step.start.x = step.start.remainder = step.start.rate = step.beyond = like;
        }
    }

    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] bool full() const noexcept { return size_ == steps_.size(); }
    [[nodiscard]] const TentativeStep<X>& operator[](std::size_t k) const noexcept
    {
        return steps_[k];
    }
    [[nodiscard]] TentativeStep<X>& add() noexcept { return steps_[size_++]; }
    void clear() noexcept { size_ = 0; }

private:
    std::vector<TentativeStep<X>> steps_;
    std::size_t size_ = 0;
};

}  // namespace ricochet::detail
