// Ctrl-C while something long is under way.
#pragma once

#include <csignal>

namespace ricochet::app {

/// While it lives, the first interrupt sets a flag; a second one ends the program.
class Interrupts {
public:
    Interrupts()
    {
        seen = 0;
        struct sigaction action = {};
        action.sa_handler = [](int) { seen = 1; };
        action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
        sigaction(SIGINT, &action, &before_int_);
        sigaction(SIGTERM, &action, &before_term_);
    }
    ~Interrupts()
    {
        sigaction(SIGINT, &before_int_, nullptr);
        sigaction(SIGTERM, &before_term_, nullptr);
    }
    Interrupts(const Interrupts&) = delete;
    Interrupts& operator=(const Interrupts&) = delete;

    [[nodiscard]] static bool any() noexcept { return seen != 0; }

private:
    inline static volatile std::sig_atomic_t seen = 0;
    struct sigaction before_int_ = {};
    struct sigaction before_term_ = {};
};

}  // namespace ricochet::app
