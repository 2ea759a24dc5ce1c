// Progress of a training, on standard error.
#pragma once

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "input.hpp"
#include "interrupt.hpp"
#include "ricochet/learn/classifier.hpp"
#include "say.hpp"

namespace ricochet::app {

/// A bar that is redrawn on a terminal; elsewhere a line every tenth of the way.
class ProgressBar {
public:
    void show(const learn::Progress& progress)
    {
        if (progress.estimate) {
            const bool known = progress.estimate->seen > 0;
            if (known) say("ricochet: {}\n", describe(*progress.estimate));
            return;
        }
        const double now = progress.seconds;
        if (progress.stage != stage_) {
            stage_ = progress.stage;
            started_ = false;
            tenth_ = 100;
            drawn_.reset();
        }
        if (!started_) {
            first_iteration_ = progress.iteration;
            first_seconds_ = now;
            started_ = true;
        }
        const auto done = static_cast<double>(progress.iteration - first_iteration_);
        const double rate = now > first_seconds_ ? done / (now - first_seconds_) : 0;
        const std::string left =
            rate > 0 ? fmt::format("{:.0f} s left",
                                   static_cast<double>(progress.total - progress.iteration) / rate)
                     : std::string("starting");
        const std::size_t percent =
            progress.total == 0 ? 100 : 100 * progress.iteration / progress.total;
        const bool trains = stage_ == learn::Progress{}.stage;
        // A stage that has just started may be refused, and some stages have no measure.
        if (!trains && (progress.total == 0 || (!terminal_ && percent < 10))) return;
        const std::string figures =
            fmt::format("{:>3} %  {} of {}{}  {}", percent, progress.iteration, progress.total,
                        trains ? "" : " events", left) +
            (trains ? fmt::format("  loss {:.2e}  {:.0f} iterations/s", progress.loss, rate) : "");
        if (terminal_) {
            const bool last = progress.iteration == progress.total;
            if (drawn_ && now - *drawn_ < redraw_every && !last) return;
            drawn_ = now;
            constexpr std::size_t width = 20;
            const std::size_t full = width * percent / 100;
            const std::string line =
                fmt::format("[{}{}] {}{}", std::string(full, '#'), std::string(width - full, '.'),
                            figures, trains ? "" : fmt::format("  {}", stage_));
            say("\r{}\x1b[K", line.substr(0, columns() - 1));
            std::fflush(stderr);
        } else if (percent / 10 != tenth_) {
            say("{}: {}\n", stage_, figures);
        }
        tenth_ = percent / 10;
    }

    /// Frees the line for other output.
    void finish() const
    {
        if (terminal_ && started_) say("\n");
    }

private:
    static constexpr double redraw_every = 0.05;  // [s]

    /// Width of the terminal: a longer line would wrap and remain.
    static std::size_t columns()
    {
        winsize size{};
        const bool known = ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1;
        return known ? size.ws_col : 80;
    }

    bool terminal_ = isatty(STDERR_FILENO) == 1;
    std::optional<double> drawn_{};  ///< [s] time of the last drawing
    std::string_view stage_;
    bool started_ = false;
    std::size_t first_iteration_ = 0;
    double first_seconds_ = 0;
    std::size_t tenth_ = 100;
};

/// Runs a training that reports progress to the given callback, until it is done or interrupted. An
/// exception before the first call is about the checkpoint to resume.
template <class Train>
auto train_under_bar(bool resume, const Train& train)
{
    ProgressBar bar;
    const Interrupts watch;
    bool started = false;
    try {
        auto out = train([&](const learn::Progress& progress) {
            started = true;
            bar.show(progress);
            return !Interrupts::any();
        });
        bar.finish();
        return out;
    } catch (const std::runtime_error& error) {
        if (resume && !started) throw BadInput(error.what());
        throw;
    }
}

}  // namespace ricochet::app
