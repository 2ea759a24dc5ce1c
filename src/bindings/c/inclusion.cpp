#include "bindings/c/inclusion.hpp"

#include <string>
#include <utility>

#include "bindings/c/callback_system.hpp"
#include "bindings/c/structs.hpp"
#include "ricochet/nonsmooth/detail/phased_run.hpp"

namespace ricochet::c {

namespace {

[[noreturn]] void refuse_inclusion(const std::string& message)
{
    throw Refusal(RC_INVALID, "rc_inclusion: " + message);
}

void require_here(bool fulfilled, const char* message)
{
    if (!fulfilled) refuse_inclusion(message);
}

/// The callbacks of a system in one mode.
class InclusionInMode final : public detail::SizedInclusion {
public:
    InclusionInMode(std::shared_ptr<const CallbackSystem> system, Mode mode)
        : system_(std::move(system)), of_(*system_->inclusion()), mode_(mode)
    {
    }

    [[nodiscard]] std::size_t size() const noexcept override { return system_->dimension(); }
    [[nodiscard]] std::size_t reactions() const noexcept override
    {
        return of_.callbacks().reactions;
    }
    void smooth(double t, const double* w, double* f) const override
    {
        heed(of_.callbacks().smooth(user(), mode_, t, w, f, size()), "smooth", t);
    }
    void bounds(double t, const double* w, double* lower, double* upper) const override
    {
        heed(of_.callbacks().bounds(user(), mode_, t, w, size(), lower, upper, reactions()),
             "bounds", t);
    }
    [[nodiscard]] bool has_offset() const noexcept override
    {
        return of_.callbacks().offset != nullptr;
    }
    void offset(double t, double* s) const override
    {
        double rate[detail::most_reactions] = {};
        read_offset(t, s, rate);
    }
    void offset_rate(double t, double* rate) const override
    {
        double s[detail::most_reactions] = {};
        read_offset(t, s, rate);
    }
    [[nodiscard]] const detail::SizedMatrices& matrices() const noexcept override
    {
        return of_.matrices();
    }
    [[nodiscard]] bool has_static_bounds() const noexcept override
    {
        return of_.callbacks().static_bounds != nullptr;
    }
    void static_bounds(double t, const double* w, double* bounds) const override
    {
        heed(of_.callbacks().static_bounds(user(), mode_, t, w, size(), bounds, reactions()),
             "static_bounds", t);
    }

private:
    void read_offset(double t, double* s, double* rate) const
    {
        if (!of_.callbacks().offset) return;
        heed(of_.callbacks().offset(user(), mode_, t, s, rate, reactions()), "offset", t);
    }
    [[nodiscard]] void* user() const noexcept { return system_->callbacks().user; }

    std::shared_ptr<const CallbackSystem> system_;
    const InclusionCallbacks& of_;
    Mode mode_;
};

}  // namespace

InclusionCallbacks::InclusionCallbacks(const rc_inclusion* given, const rc_callbacks& system)
    : at_(read_struct<rc_inclusion>(given, "rc_inclusion"))
{
    const std::size_t n = system.dimension, m = at_.reactions;
    if (m == 0 || m > detail::most_reactions) {
        refuse_inclusion("reactions must be 1 to " + std::to_string(detail::most_reactions) +
                         ", got " + std::to_string(m));
    }
    if (n > detail::most_components) {
        refuse_inclusion("the state must have at most " + std::to_string(detail::most_components) +
                         " components, got " + std::to_string(n));
    }
    require_here(at_.smooth, "found no smooth; expected a callback");
    require_here(at_.bounds, "found no bounds; expected a callback");
    require_here(at_.observe || m <= n,
                 "found no observe, and more reactions than components; expected the matrix E");
    require_here(!at_.in_modes || system.mode_count > 0,
                 "found in_modes with a mode_count of 0; expected null");
    require_here(!at_.start_mode || system.mode_count > 0,
                 "found a start_mode with a mode_count of 0; expected null");
    if (system.mode_count > detail::most_inclusions) {
        refuse_inclusion("mode_count must be at most " + std::to_string(detail::most_inclusions) +
                         ", got " + std::to_string(system.mode_count));
    }
    if (at_.mass) matrices_.mass.assign(at_.mass, at_.mass + n * n);
    if (at_.observe) matrices_.observe.assign(at_.observe, at_.observe + m * n);
    if (at_.act) matrices_.act.assign(at_.act, at_.act + n * m);
    if (at_.in_modes) in_modes_.assign(at_.in_modes, at_.in_modes + system.mode_count);
    if (at_.stands_for) stands_for_.assign(at_.stands_for, at_.stands_for + system.guard_count);
    for (std::size_t i = 0; i < stands_for_.size(); ++i) {
        if (stands_for_[i] < m || stands_for_[i] == RC_NO_REACTION) continue;
        refuse_inclusion("stands_for of guard " + std::to_string(i) + " must be below " +
                         std::to_string(m) + ", the number of reactions, or RC_NO_REACTION, got " +
                         std::to_string(stands_for_[i]));
    }
    at_.mass = at_.observe = at_.act = nullptr;
    at_.stands_for = nullptr;
    at_.in_modes = nullptr;
}

detail::Shared<const detail::SizedInclusion> inclusion_in(
    std::shared_ptr<const CallbackSystem> system, Mode mode)
{
    return detail::Shared<const detail::SizedInclusion>::make<InclusionInMode>(std::move(system),
                                                                               mode);
}

}  // namespace ricochet::c
