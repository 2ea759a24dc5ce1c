#include "ricochet/fmi/check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "fmi/instance.hpp"

namespace ricochet::fmi {

namespace {

using Values = std::vector<double>;

bool same_bits(const Values& a, const Values& b)
{
    return a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

/// The first moments of an instance, looked at more closely than a run does.
class Start {
public:
    Start(const Fmu& fmu, const Options& options)
        : instance_(fmu.unpacked(), Kind::model_exchange), d_(instance_.description())
    {
        t_ = options.t_start.value_or(d_.t_start.value_or(0));
        const double t_end = options.t_end.value_or(std::max(d_.t_end.value_or(t_ + 1), t_));
        for (const auto& [name, value] : options.start) {
            if (const auto element = d_.find(name)) instance_.set(*element, value);
        }
        instance_.enter_initialization(t_, t_end, options.rtol);
        instance_.exit_initialization();
        const EventInfo info = instance_.iterate();
        if (info.next_time < t_) {
            fault(fmt::format("names a time event at {} s, before the start at {} s",
                              info.next_time, t_));
        }
        runs_ = !info.terminate;
        if (runs_) instance_.enter_continuous_time_mode();
    }

    std::vector<Finding> examine()
    {
        if (!runs_) return findings_;
        x_.resize(instance_.states());
        if (!x_.empty()) instance_.read_states(x_);
        examine_nominals();
        examine_values();
        return findings_;
    }

private:
    void fault(std::string text) { findings_.push_back({true, std::move(text)}); }
    void remark(std::string text) { findings_.push_back({false, std::move(text)}); }

    void examine_nominals()
    {
        Values nominals(x_.size());
        if (!x_.empty()) instance_.read_nominals(nominals);
        const std::vector<std::string> names = d_.state_names();
        for (std::size_t i = 0; i < x_.size(); ++i) {
            if (!std::isfinite(nominals[i])) {
                fault(fmt::format("the nominal value of '{}' is {}", names[i], nominals[i]));
            } else if (nominals[i] <= 0) {
                remark(fmt::format("the nominal value of '{}' is {}; expected a positive one",
                                   names[i], nominals[i]));
            } else if (nominals[i] == 1 && std::fabs(x_[i]) >= 1e4) {
                remark(
                    fmt::format("the nominal value of '{}' is 1, its start {}", names[i], x_[i]));
            }
        }
    }

    struct Point {
        Values rates, indicators;
    };
    [[nodiscard]] Point at(double t, const Values& x)
    {
        Point p{Values(x.size()), Values(instance_.indicators())};
        const bool given = instance_.place(t, x) && (x.empty() || instance_.derivatives(p.rates)) &&
                           (p.indicators.empty() || instance_.indicator_values(p.indicators));
        if (!given) p.rates.assign(x.size(), std::nan(""));
        return p;
    }

    void examine_values()
    {
        const Point first = at(t_, x_);
        const std::vector<std::string> names = d_.state_names();
        for (std::size_t i = 0; i < x_.size(); ++i) {
            if (std::isfinite(first.rates[i])) continue;
            fault(fmt::format("the rate of '{}' is {} at the start", names[i], first.rates[i]));
            return;
        }
        for (std::size_t k = 0; k < first.indicators.size(); ++k) {
            const double z = first.indicators[k];
            if (z == 0 || !std::isfinite(z)) {
                fault(fmt::format("{} is {} after event mode", d_.indicator_name(k), z));
            }
        }
        // A little later along the flow, and back: the start was no event mode ago.
        constexpr double length = 1e-6;
        Values there = x_;
        for (std::size_t i = 0; i < x_.size(); ++i) there[i] += length * first.rates[i];
        const Point later = at(t_ + length, there);
        const Point again = at(t_, x_);
        if (!same_bits(first.rates, again.rates)) {
            fault("rates at one point depend on the points evaluated before");
        }
        if (!same_bits(first.indicators, again.indicators)) {
            fault("indicators at one point depend on the points evaluated before");
        }
        for (std::size_t k = 0; k < first.indicators.size(); ++k) {
            if (std::fabs(first.indicators[k]) == 1 && first.indicators[k] == later.indicators[k]) {
                remark(fmt::format("{} seems to be +1 or -1, which cannot be interpolated",
                                   d_.indicator_name(k)));
            }
        }
    }

    Instance instance_;
    const Description& d_;
    double t_ = 0;
    bool runs_ = true;
    Values x_;
    std::vector<Finding> findings_;
};

}  // namespace

std::vector<Finding> check(const Fmu& fmu, const Options& options)
{
    std::vector<Finding> findings = [&] {
        try {
            return Start(fmu, options).examine();
        } catch (const CallError& error) {
            return std::vector<Finding>{{true, error.what()}};
        }
    }();
    if (std::ranges::any_of(findings, &Finding::fault)) return findings;
    Options run_options = options;
    run_options.co_simulation = false;
    const Run out = run(fmu, run_options);
    for (const std::string& warning : out.warnings) {
        const bool derivative = warning.starts_with("the derivative");
        if (derivative) findings.push_back({true, warning});
    }
    if (out.end != End::reached_end && out.end != End::terminated) {
        findings.push_back({true, describe(out)});
    }
    return findings;
}

}  // namespace ricochet::fmi
