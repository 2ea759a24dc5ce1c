// Fields that meet at switching surfaces, as the source of runs.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ricochet/times.hpp"
#include "source.hpp"

namespace ricochet::python {

/// Fields of Python at one or two switching surfaces; the motion slides where both lead to one.
class FilippovSource final : public Source {
public:
    /// @param fields    a source for each region, whose flow is the field there; the first has the
    /// surfaces as its first guards, and the guards and the time reset of the fields
    /// @param surfaces  1 or 2
    /// @param rated     whether the rates of all surfaces are given
    /// @throws std::invalid_argument if the restoring rate is negative or not finite
    FilippovSource(std::vector<std::shared_ptr<const Source>> fields, std::size_t surfaces,
                   bool rated, const std::optional<Times>& times, double restoring_rate);

    [[nodiscard]] const std::vector<std::shared_ptr<const Source>>& fields() const noexcept
    {
        return fields_;
    }
    [[nodiscard]] std::size_t surfaces() const noexcept { return surfaces_; }
    [[nodiscard]] bool is_rated() const noexcept { return rated_; }
    [[nodiscard]] const Times& times() const noexcept { return times_; }
    [[nodiscard]] double restoring_rate() const noexcept { return restoring_rate_; }

    [[nodiscard]] std::unique_ptr<RunAdapter> open(const State& x0) const override;
    [[nodiscard]] std::unique_ptr<RunAdapter> open_implicit(const State& x0) const override;
    [[nodiscard]] std::vector<std::string> mode_names() const override { return {}; }
    [[nodiscard]] std::vector<std::string> guard_names() const override;

    /// See `Filippov::start_mode` and `Filippov::shares`.
    [[nodiscard]] Mode start_mode_at(double t, const State& x, double tolerance) const;
    [[nodiscard]] State shares(Mode mode, double t, const State& x) const;

private:
    std::vector<std::shared_ptr<const Source>> fields_;
    std::size_t surfaces_;
    bool rated_;
    Times times_;
    double restoring_rate_;
};

}  // namespace ricochet::python
