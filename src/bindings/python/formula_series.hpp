// The power series of a flow and of guards that are formulas.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "formula.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/taylor/detail/lazy_tape.hpp"

namespace ricochet::python {

/// For each mode: the tape, and code that is made after some steps of any runs.
class FormulaSeries {
public:
    /// Keeps references to the formulas and to the parameters that they are given.
    FormulaSeries(const ModedFormula& flow, std::vector<const ModedFormula*> guards,
                  const double* parameters = nullptr)
        : flow_(&flow),
          guards_(std::move(guards)),
          parameters_(parameters),
          modes_(flow.by_mode.size())
    {
        for (auto& mode : modes_) mode = std::make_unique<InMode>();
    }

    [[nodiscard]] const ModedFormula& flow() const noexcept { return *flow_; }
    [[nodiscard]] const std::vector<const ModedFormula*>& guards() const noexcept
    {
        return guards_;
    }
    [[nodiscard]] const double* parameters() const noexcept { return parameters_; }
    [[nodiscard]] std::size_t modes() const noexcept { return modes_.size(); }
    /// The code in a mode, or null.
    [[nodiscard]] SeriesCode code(Mode mode) const noexcept { return in(mode).code.get(); }
    /// Whether the motion is a polynomial; known with the code.
    [[nodiscard]] bool is_polynomial(Mode mode) const noexcept { return in(mode).is_polynomial; }
    /// The operations in a mode, recorded once; runs compute with copies.
    /// @throws std::invalid_argument  a constant is not finite; `name` is that of the system
    [[nodiscard]] const detail::LazyTape& tape(Mode mode, const std::string& name) const;
    /// The code of four motions in the first mode, or null; made when it is first asked for.
    [[nodiscard]] LanesCode lanes(const std::string& name) const
    {
        std::call_once(lanes_asked_, [&] { lanes_ = code_of_lanes(tape(0, name)); });
        return lanes_.as<LanesCode>();
    }
    /// Counts a step that was computed by the tape.
    void count(Mode mode, const detail::LazyTape& tape) const noexcept
    {
        constexpr std::uint32_t enough = 50;
        InMode& of = in(mode);
        of.code.count(enough, [&] {
            of.is_polynomial = tape.is_polynomial();
            return code_of_series(tape);
        });
    }

private:
    struct InMode {
        LateCode<SeriesCode> code;
        bool is_polynomial = false;
        std::once_flag recorded;
        detail::LazyTape tape;
    };
    [[nodiscard]] detail::LazyTape record(Mode mode) const;
    [[nodiscard]] InMode& in(Mode mode) const noexcept
    {
        return *modes_[mode < modes_.size() ? mode : 0];
    }

    const ModedFormula* flow_;
    std::vector<const ModedFormula*> guards_;
    const double* parameters_;
    std::vector<std::unique_ptr<InMode>> modes_;
    mutable std::once_flag lanes_asked_;
    mutable MachineCode lanes_;
};

}  // namespace ricochet::python
