// An inclusion whose functions are a C program's.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "nonsmooth/sized_inclusion.hpp"
#include "ricochet/ricochet.h"

namespace ricochet::c {

class CallbackSystem;

/// A copy of an rc_inclusion.
class InclusionCallbacks {
public:
    /// @throws Refusal naming the invalid field.
    InclusionCallbacks(const rc_inclusion* given, const rc_callbacks& system);

    [[nodiscard]] const rc_inclusion& callbacks() const noexcept { return at_; }
    /// Whether a mode has an inclusion.
    [[nodiscard]] bool is_in(std::size_t mode) const noexcept
    {
        return in_modes_.empty() || in_modes_[mode] != 0;
    }
    /// The reaction of a guard, or RC_NO_REACTION.
    [[nodiscard]] std::size_t reaction_of(std::size_t guard) const noexcept
    {
        return stands_for_.empty() ? RC_NO_REACTION : stands_for_[guard];
    }
    [[nodiscard]] const detail::SizedMatrices& matrices() const noexcept { return matrices_; }

private:
    rc_inclusion at_;
    detail::SizedMatrices matrices_;
    std::vector<std::size_t> stands_for_;
    std::vector<std::int32_t> in_modes_;
};

/// The inclusion of a system in a mode.
[[nodiscard]] detail::Shared<const detail::SizedInclusion> inclusion_in(
    std::shared_ptr<const CallbackSystem> system, Mode mode);

}  // namespace ricochet::c
