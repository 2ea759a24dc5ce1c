// Requests that end a command early and keep its results so far: Ctrl-C, a request to terminate,
// a terminal that is closed, memory that runs short.
#pragma once

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <string_view>

namespace ricochet::app {

/// The reason for ending a command early.
enum class Cause : int {
    none = 0,
    interrupt = SIGINT,
    terminate = SIGTERM,
    hang_up = SIGHUP,
    memory = -1,
};

/// During its life the first interrupt sets a flag that runs examine after every step; a second one
/// ends the program.
class Interrupts {
public:
    Interrupts()
    {
        cause_ = 0;
        flag_ = false;
        struct sigaction action = {};
        action.sa_handler = [](int signal) {
            constexpr std::string_view answer =
                "\nricochet: ending with what there is; a second interrupt ends without\n";
            [[maybe_unused]] const auto written =
                write(STDERR_FILENO, answer.data(), answer.size());
            raise_for(static_cast<Cause>(signal));
        };
        action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
        sigaction(SIGINT, &action, &before_int_);
        sigaction(SIGTERM, &action, &before_term_);
        sigaction(SIGHUP, &action, &before_hup_);
        // Set by `nohup`: the command outlives its terminal.
        if (before_hup_.sa_handler == SIG_IGN) sigaction(SIGHUP, &before_hup_, nullptr);
    }
    ~Interrupts()
    {
        sigaction(SIGINT, &before_int_, nullptr);
        sigaction(SIGTERM, &before_term_, nullptr);
        sigaction(SIGHUP, &before_hup_, nullptr);
    }
    Interrupts(const Interrupts&) = delete;
    Interrupts& operator=(const Interrupts&) = delete;

    /// Safe in a signal handler and in any thread; the first cause is kept.
    static void raise_for(Cause cause) noexcept
    {
        int none = 0;
        cause_.compare_exchange_strong(none, static_cast<int>(cause));
        flag_ = true;
    }

    [[nodiscard]] static bool any() noexcept { return flag_.load(std::memory_order_relaxed); }
    /// The flag to pass as `Options::cancelled`.
    [[nodiscard]] static const std::atomic<bool>* flag() noexcept { return &flag_; }

    /// "interrupted"; empty without an interrupt.
    [[nodiscard]] static std::string_view cause() noexcept
    {
        switch (static_cast<Cause>(cause_.load())) {
            case Cause::none: break;
            case Cause::interrupt: return "interrupted";
            case Cause::terminate: return "asked to terminate";
            case Cause::hang_up: return "left by its terminal";
            case Cause::memory: return "no memory was left for more";
        }
        return "";
    }

    /// Exit status of a command that was ended early: 128 plus the signal, as in a shell.
    [[nodiscard]] static int status() noexcept
    {
        const int cause = cause_.load();
        return cause > 0 ? 128 + cause : 1;
    }

private:
    inline static std::atomic<int> cause_ = 0;
    inline static std::atomic<bool> flag_ = false;
    static_assert(std::atomic<int>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);
    struct sigaction before_int_ = {};
    struct sigaction before_term_ = {};
    struct sigaction before_hup_ = {};
};

}  // namespace ricochet::app
