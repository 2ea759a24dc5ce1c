#include "td3_losses.hpp"

#include <algorithm>
#include <cmath>

namespace ricochet::learn {

template <class T>
Td3Losses<T>::Td3Losses(const Td3Shape& shape)
    : shape_(shape),
      actor_(shape.observations, shape.actor, shape.actions),
      critic_(shape.observations + shape.actions, shape.critic, 1)
{
}

template <class T>
typename Td3Losses<T>::Work Td3Losses<T>::work(std::size_t most_rows) const
{
    const std::size_t pair = padded<T>(shape_.observations + shape_.actions);
    Work work{.batch = {shape_.observations, shape_.actions, most_rows},
              .smoothing = Buffer<T>(most_rows * padded<T>(shape_.actions)),
              .actor = actor_.work(most_rows),
              .critics = {},
              .pairs = Buffer<T>(most_rows * pair),
              .targets = Buffer<T>(most_rows),
              .by_pair = Buffer<T>(most_rows * pair)};
    for (std::size_t c = 0; c < shape_.critics; ++c) {
        work.critics.push_back(critic_.work(most_rows));
    }
    return work;
}

/// Pairs of the states and the policy's actions.
template <class T>
void Td3Losses<T>::act(const T* actor, Rows<const T> states, Work& work) const
{
    const Rows<T> out = actor_.forward(actor, states, work.batch.rows, work.actor);
    for (std::size_t i = 0; i < work.batch.rows; ++i) {
        for (std::size_t a = 0; a < shape_.actions; ++a) {
            out.row(i)[a] = std::tanh(out.row(i)[a]);
        }
    }
    join<T>(states, shape_.observations, {out.data, out.stride}, shape_.actions, work.batch.rows,
            {work.pairs.data(), work.batch.pair_stride()});
}

template <class T>
double Td3Losses<T>::critic_part(const Parameters& p, Work& work, T* gradient) const
{
    const Transitions<T>& batch = work.batch;
    const Rows<T> next{work.pairs.data(), batch.pair_stride()};
    act(p.target_actor, {batch.next_states.data(), batch.stride()}, work);
    for (std::size_t i = 0; i < batch.rows; ++i) {
        const T* e = work.smoothing.data() + i * padded<T>(shape_.actions);
        T* action = next.row(i) + shape_.observations;
        for (std::size_t a = 0; a < shape_.actions; ++a) {
            action[a] = std::clamp(action[a] + e[a], T(-1), T(1));
        }
    }
    for (std::size_t c = 0; c < shape_.critics; ++c) {
        const Rows<T> q = critic_.forward(p.target_critics + c * critic_.size(),
                                          {next.data, next.stride}, batch.rows, work.critics[c]);
        for (std::size_t i = 0; i < batch.rows; ++i) {
            const T y = batch.rewards[i] + p.discount * batch.going_on[i] * q.row(i)[0];
            work.targets[i] = c == 0 ? y : std::min(work.targets[i], y);
        }
    }

    const Rows<const T> pairs{batch.pairs.data(), batch.pair_stride()};
    double loss = 0;
    for (std::size_t c = 0; c < shape_.critics; ++c) {
        typename BatchMlp<T>::Work& critic = work.critics[c];
        const Rows<T> q =
            critic_.forward(p.critics + c * critic_.size(), pairs, batch.rows, critic);
        const Rows<T> by_q = critic_.slopes_out(critic);
        for (std::size_t i = 0; i < batch.rows; ++i) {
            const T d = q.row(i)[0] - work.targets[i];
            by_q.row(i)[0] = 2 * d / static_cast<T>(p.batch);
            loss += static_cast<double>(d) * static_cast<double>(d);
        }
        critic_.backward(p.critics_transposed + c * critic_.transposed_size(), pairs, batch.rows,
                         critic, gradient + c * critic_.size(), nullptr);
    }
    return loss / static_cast<double>(p.batch);
}

template <class T>
double Td3Losses<T>::actor_part(const Parameters& p, Work& work, T* gradient) const
{
    const Transitions<T>& batch = work.batch;
    const Rows<const T> states{batch.states.data(), batch.stride()};
    const Rows<const T> pairs{work.pairs.data(), batch.pair_stride()};
    act(p.actor, states, work);
    typename BatchMlp<T>::Work& critic = work.critics.front();
    const Rows<T> q = critic_.forward(p.critics, pairs, batch.rows, critic);
    double value = 0;
    for (std::size_t i = 0; i < batch.rows; ++i) {
        value += static_cast<double>(q.row(i)[0]);
        critic_.slopes_out(critic).row(i)[0] = -1 / static_cast<T>(p.batch);
    }
    critic_.backward(p.critics_transposed, pairs, batch.rows, critic, nullptr, work.by_pair.data());

    const Rows<T> by_output = actor_.slopes_out(work.actor);
    for (std::size_t i = 0; i < batch.rows; ++i) {
        const T* action = pairs.row(i) + shape_.observations;
        const T* by_action = work.by_pair.data() + i * pairs.stride + shape_.observations;
        for (std::size_t a = 0; a < shape_.actions; ++a) {
            by_output.row(i)[a] = by_action[a] * (1 - action[a] * action[a]);
        }
    }
    actor_.backward(p.actor_transposed, states, batch.rows, work.actor, gradient, nullptr);
    return -value / static_cast<double>(p.batch);
}

template class Td3Losses<float>;
template class Td3Losses<double>;

}  // namespace ricochet::learn
