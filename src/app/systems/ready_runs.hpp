// The functions of the entry of a ready system.
#pragma once

#include <algorithm>
#include <span>
#include <stdexcept>
#include <vector>

#include "../input.hpp"
#include "ready_entry.hpp"
#include "run_system.hpp"

namespace ricochet::app {

template <class System>
struct ReadyRuns {
    using Numbers = std::vector<double>;

    [[nodiscard]] static std::span<const double> own_parameters(const Numbers& p)
    {
        return std::span(p).first(System::descriptor().parameters.size());
    }
    [[nodiscard]] static System system(const Numbers& p)
    {
        return with_parameters<System>(own_parameters(p));
    }
    [[nodiscard]] static typename System::State start(const Numbers& p)
    {
        const Numbers from = start_from(System::descriptor(), p);
        typename System::State x;
        std::copy_n(from.begin(), x.size(), x.begin());
        return x;
    }
    [[nodiscard]] static TimedRun run(const RunSettings& settings, int repeats)
    {
        const Numbers& p = settings.parameters;
        return run_system(system(p), start(p), settings, repeats);
    }
    [[nodiscard]] static Numbers event_times(const Numbers& p, double t_end)
    {
        const SystemDescriptor& of = System::descriptor();
        try {
            return of.event_times(own_parameters(p), start_from(of, p), t_end);
        } catch (const std::invalid_argument& error) {
            throw BadInput(error.what());
        }
    }

    static void give_to(SystemEntry& entry)
    {
        entry.run = run;
        if (System::descriptor().event_times) entry.exact_events = event_times;
        if constexpr (requires(const System& s) { s.mode_at(0.0, 0.0); }) {
            entry.start_mode = [](const Numbers& p) {
                const auto x = start(p);
                return system(p).mode_at(x[0], x[1]);
            };
        } else if constexpr (requires { System::start_mode; }) {
            entry.start_mode = [](const Numbers&) { return System::start_mode; };
        }
    }
};

}  // namespace ricochet::app
