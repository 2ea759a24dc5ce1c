// The meter of a run's network, or none.
#pragma once

#include <cstddef>
#include <optional>

#include "ricochet/detail/meter.hpp"

namespace ricochet::detail {

/// Interface of `Meter`; without one, the network is always asked and planning is always on.
class MeterOfRun {
public:
    explicit MeterOfRun(const MeterOptions* options, std::size_t planned_guards = 0)
    {
        if (options) meter_.emplace(*options, planned_guards);
    }

    [[nodiscard]] bool asks() const noexcept { return !meter_ || meter_->asks(); }
    [[nodiscard]] bool checks() const noexcept { return meter_ && meter_->checks(); }
    void note_cleared() noexcept
    {
        if (meter_) meter_->note_cleared();
    }
    void review(const Statistics& counts)
    {
        if (meter_) meter_->review(counts);
    }
    [[nodiscard]] MeterReading reading() const { return meter_->reading(); }

    template <class Call>
    auto time_guard(const Call& call)
    {
        return meter_ ? meter_->time_guard(call) : call();
    }
    template <class Call>
    auto time_network(const Call& call)
    {
        return meter_ ? meter_->time_network(call) : call();
    }

private:
    std::optional<Meter> meter_;
};

}  // namespace ricochet::detail
