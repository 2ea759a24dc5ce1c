// Transitions from which a learner learns, stored and sampled.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "batch_mlp.hpp"
#include "learn/checkpoint_file.hpp"

namespace ricochet::learn {

/// The last transitions, at most `capacity`.
class ReplayBuffer {
public:
    ReplayBuffer(std::size_t observations, std::size_t actions, std::size_t capacity)
        : observations_(observations),
          actions_(actions),
          width_(2 * observations + actions + 2),
          capacity_(capacity)
    {
    }

    void push(std::span<const double> state, std::span<const double> action, double reward,
              bool terminal, std::span<const double> next)
    {
        if (size_ < capacity_) numbers_.resize(++size_ * width_);
        float* to = numbers_.data() + next_ * width_;
        const auto put = [&to](double value) { *to++ = static_cast<float>(value); };
        std::for_each(state.begin(), state.end(), put);
        std::for_each(action.begin(), action.end(), put);
        std::for_each(next.begin(), next.end(), put);
        put(reward);
        put(terminal ? 1 : 0);
        next_ = (next_ + 1) % capacity_;
    }

    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] std::size_t observations() const noexcept { return observations_; }
    [[nodiscard]] std::size_t actions() const noexcept { return actions_; }

    /// State, action, next state, reward, and 1 if it is terminal.
    [[nodiscard]] const float* operator[](std::size_t i) const noexcept
    {
        return numbers_.data() + i * width_;
    }

    void save(Writer& writer) const
    {
        writer.put(std::uint64_t{next_});
        writer.put(numbers_);
    }

    /// Whether the data read are a buffer of this width and capacity.
    [[nodiscard]] bool load(Reader& reader)
    {
        std::uint64_t next = 0;
        reader.get(next);
        reader.get(numbers_);
        next_ = static_cast<std::size_t>(next);
        size_ = numbers_.size() / width_;
        return numbers_.size() % width_ == 0 && size_ <= capacity_ &&
               next_ == (size_ < capacity_ ? size_ : next_ % capacity_);
    }

private:
    std::size_t observations_;
    std::size_t actions_;
    std::size_t width_;
    std::size_t capacity_;
    std::size_t size_ = 0;
    std::size_t next_ = 0;  ///< next place to be written
    std::vector<float> numbers_;
};

/// Transitions as matrices, as passed to a thread.
template <class T>
struct Transitions {
    Transitions(std::size_t observations, std::size_t actions, std::size_t most_rows)
        : observations(observations),
          actions(actions),
          states(most_rows * padded<T>(observations)),
          next_states(states),
          pairs(most_rows * padded<T>(observations + actions)),
          rewards(most_rows),
          going_on(most_rows)
    {
    }

    /// Stores this transition in row i.
    void set(std::size_t i, const float* state_action_next_reward_terminal)
    {
        const float* from = state_action_next_reward_terminal;
        T* pair = pairs.data() + i * pair_stride();
        std::copy(from, from + observations + actions, pair);
        std::copy(from, from + observations, states.data() + i * stride());
        from += observations + actions;
        std::copy(from, from + observations, next_states.data() + i * stride());
        rewards[i] = from[observations];
        going_on[i] = 1 - from[observations + 1];
    }

    [[nodiscard]] std::size_t stride() const noexcept { return padded<T>(observations); }
    [[nodiscard]] std::size_t pair_stride() const noexcept
    {
        return padded<T>(observations + actions);
    }

    std::size_t observations;
    std::size_t actions;
    std::size_t rows = 0;
    Buffer<T> states, next_states;
    Buffer<T> pairs;  ///< state and action
    Buffer<T> rewards;
    Buffer<T> going_on;  ///< 0 after a terminal step, else 1
};

/// Rows of (state, action) from the two.
template <class T>
void join(Rows<const T> states, std::size_t observations, Rows<const T> actions,
          std::size_t n_actions, std::size_t rows, Rows<T> out)
{
    for (std::size_t i = 0; i < rows; ++i) {
        std::copy_n(states.row(i), observations, out.row(i));
        std::copy_n(actions.row(i), n_actions, out.row(i) + observations);
    }
}

}  // namespace ricochet::learn
