// Bodies joined by springs, or slowed by drag, and systems: each island advances by its own steps
// of dopri5.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "ricochet/scene/detail/any_scene_system.hpp"
#include "scene/world.hpp"

namespace ricochet::detail {

/// State of an island: x, y, x', y' of each member. Between two impacts an island's steps depend on
/// its members alone.
class Islands {
public:
    explicit Islands(World& world);

    /// Number of islands, and members of each.
    [[nodiscard]] std::size_t count() const noexcept { return islands_.size(); }
    [[nodiscard]] const std::vector<std::uint32_t>& members(std::uint32_t island) const
    {
        return islands_[island].members;
    }
    [[nodiscard]] const Instant& end(std::uint32_t island) const { return islands_[island].end; }

    /// By the method's own map: the current step is repeated with another length.
    [[nodiscard]] Vector2 position(std::uint32_t body, const Instant& t) const;
    [[nodiscard]] Vector2 velocity(std::uint32_t body, const Instant& t) const;

    /// Takes the next step of an island; its members get new records. False where no step is short
    /// enough, or the result is not finite.
    bool advance(std::uint32_t island);
    /// Whether the steps of an island have become so short that it will hardly reach the end.
    [[nodiscard]] bool stalls(std::uint32_t island) const;

    /// Continues an island from t with changed velocities of some members: the current step is cut
    /// there, and its length is kept for the next one.
    bool restart(std::uint32_t island, const Instant& t,
                 const std::vector<std::pair<std::uint32_t, Vector2>>& velocities);

    /// Suspends an island: its members now advance as part of a group in lasting contact.
    void suspend(std::uint32_t island);
    /// Continues a suspended island from t with these positions and velocities, in the order of its
    /// members.
    bool resume(std::uint32_t island, const Instant& t,
                const std::vector<std::array<Vector2, 2>>& states);

    struct Join {
        std::uint32_t a = 0, b = 0;  ///< bodies
        double rest = 0, stiffness = 0, damping = 0;
    };
    /// Springs of an island.
    [[nodiscard]] std::vector<Join> springs(std::uint32_t island) const;

    /// Marks the island of one body that can meet neither a body nor a surface.
    void set_unseen(std::uint32_t island) { islands_[island].unseen = !islands_[island].system; }
    [[nodiscard]] bool unseen(std::uint32_t island) const { return islands_[island].unseen; }

    // --- systems: the members of such an island are the discs of one system ---

    [[nodiscard]] bool is_system(std::uint32_t island) const
    {
        return islands_[island].system != nullptr;
    }
    /// Whether the current step of a system ends at t at events of its own.
    [[nodiscard]] bool is_cut_at(std::uint32_t island, const Instant& t) const
    {
        return islands_[island].cut && islands_[island].end.value <= t.value;
    }
    /// By the method's own map.
    [[nodiscard]] const std::vector<double>& state(std::uint32_t island, const Instant& t) const;
    /// Continues a system from t with its discs pushed by these impulses, as `restart` does.
    bool push(std::uint32_t island, const Instant& t,
              const std::vector<std::pair<std::uint32_t, Vector2>>& impulses);
    /// Changes of the velocity of disc `of` when disc `by` is pushed by (1, 0) and by (0, 1).
    [[nodiscard]] std::array<Vector2, 2> mobility(std::uint32_t of, std::uint32_t by,
                                                  const Instant& t) const;
    /// Reason why an island did not continue, unless it is only that its steps became too short.
    struct Trouble {
        Outcome outcome = Outcome::step_underflow;
        std::string what;  ///< of its first member
    };
    [[nodiscard]] const std::optional<Trouble>& trouble() const noexcept { return trouble_; }

private:
    using State = std::vector<double>;
    struct Link {
        std::uint32_t a = 0, b = 0;  ///< places in the island
        double rest = 0, stiffness = 0, damping = 0;
    };
    struct Island {
        std::vector<std::uint32_t> members;
        std::vector<Link> links;
        std::vector<double> drag, inverse_mass;
        Instant start{}, end{};
        double h = 0;     ///< of the current step
        double next = 0;  ///< length that the error allows
        bool started = false;
        bool unseen = false;  ///< one body that can meet nothing: its record has no polynomial
        std::uint32_t short_steps = 0;         ///< in a row
        State x, remainder, rate;              ///< at the start of the current step
        State x_end, remainder_end, rate_end;  ///< at its end
        std::shared_ptr<const SceneSystem> system;
        std::unique_ptr<SystemEvents> events;
        Mode mode = 0;
        Mode mode_after = 0;
        bool cut = false;  ///< whether its step ends at events, which have produced x_end
    };
    class Step;

    void join(World& world);
    template <class AnyState>
    void flow(const Island& island, const AnyState& x, AnyState& rate, double s) const;
    void add_systems();
    void record_system(Island& island);
    bool find_events(Island& island);
    bool follow(Island& island, StepVerdict verdict);
    void restep(const Island& island, double s, std::span<double> x) const;
    [[nodiscard]] SystemDisc disc(std::uint32_t body, const Instant& t) const;
    void depart(const Island& island, double h, bool with_error) const;
    template <std::size_t n, class Flow>
    void depart_few(const Island& island, double h, bool with_error, const Flow& flow) const;
    [[nodiscard]] double error_of(const Island& island, double h) const;
    void look_at(const Island& island, const Instant& t) const;
    [[nodiscard]] double first_step(const Island& island) const;
    bool attempt(std::uint32_t which);
    bool record(Island& island);

    World& world_;
    std::vector<Island> islands_;
    std::vector<std::uint32_t> place_;  ///< of a body in its island
    mutable std::vector<State> stages_;
    mutable State w_, end_rate_, error_, middle_, at_, point_;
    mutable const Island* seen_ = nullptr;  ///< the island whose state at `seen_at_` is in `at_`
    mutable Instant seen_at_{};
    mutable Instant seen_from_{};
    mutable std::vector<State> spare_stages_;
    mutable State spare_w_, spare_end_rate_;
    std::optional<Trouble> trouble_;
};

}  // namespace ricochet::detail
