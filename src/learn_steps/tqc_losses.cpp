#include "tqc_losses.hpp"

#include <algorithm>

namespace ricochet::learn {

template <class T>
TqcLosses<T>::TqcLosses(const TqcShape& shape)
    : shape_(shape),
      actor_(shape.observations, shape.actor, shape.actions),
      critic_(shape.observations + shape.actions, shape.critic, shape.quantiles),
      above_(padded<T>(shape.quantiles)),
      below_(above_),
      kernels_(&dense_kernels<T>())
{
    for (std::size_t i = 0; i < shape.quantiles; ++i) {
        above_[i] = (static_cast<T>(i) + T(0.5)) / static_cast<T>(shape.quantiles);
        below_[i] = 1 - above_[i];
    }
}

template <class T>
typename TqcLosses<T>::Work TqcLosses<T>::work(std::size_t most_rows) const
{
    const std::size_t pair = padded<T>(shape_.observations + shape_.actions);
    Work work{.batch = {shape_.observations, shape_.actions, most_rows},
              .actor = actor_.work(most_rows),
              .critics = {},
              .pairs = Buffer<T>(most_rows * pair),
              .pool = Buffer<T>(most_rows * shape_.critics * shape_.quantiles),
              .by_pair = Buffer<T>(most_rows * pair),
              .by_action = Buffer<T>(most_rows * padded<T>(shape_.actions))};
    for (std::size_t c = 0; c < shape_.critics; ++c) {
        work.critics.push_back(critic_.work(most_rows));
    }
    return work;
}

/// The first CM - dC numbers of each row of the pool become its targets.
template <class T>
void TqcLosses<T>::make_targets(const Parameters& p, Work& work) const
{
    const Transitions<T>& batch = work.batch;
    const std::size_t all = shape_.critics * shape_.quantiles;
    const Rows<const T> next{batch.next_states.data(), batch.stride()};
    const Rows<T> pairs{work.pairs.data(), batch.pair_stride()};
    actor_.forward(p.actor, *p.noise, next, batch.rows, work.actor);
    join<T>(next, shape_.observations, {work.actor.actions.data(), padded<T>(shape_.actions)},
            shape_.actions, batch.rows, pairs);
    for (std::size_t c = 0; c < shape_.critics; ++c) {
        const Rows<T> z = critic_.forward(p.targets + c * critic_.size(),
                                          {pairs.data, pairs.stride}, batch.rows, work.critics[c]);
        for (std::size_t i = 0; i < batch.rows; ++i) {
            std::copy_n(z.row(i), shape_.quantiles,
                        work.pool.data() + i * all + c * shape_.quantiles);
        }
    }
    const auto kept = static_cast<std::ptrdiff_t>(all - shape_.dropped * shape_.critics);
    for (std::size_t i = 0; i < batch.rows; ++i) {
        T* z = work.pool.data() + i * all;
        T check = 0;  // NaN if one of them is not finite: they could not be sorted
        for (std::size_t j = 0; j < all; ++j) check += T(0) * z[j];
        if (check == 0) std::nth_element(z, z + kept, z + all);
        const T entropy = p.temperature * work.actor.log_density[i];
        for (std::ptrdiff_t j = 0; j < kept; ++j) {
            z[j] = batch.rewards[i] + p.discount * batch.going_on[i] * (z[j] - entropy);
        }
    }
}

/// Slopes of the critics' outputs, and the loss if requested.
template <class T>
double TqcLosses<T>::huber(Work& work, const Parameters& p, bool loss) const
{
    const std::size_t all = shape_.critics * shape_.quantiles;
    const std::size_t kept = all - shape_.dropped * shape_.critics;
    const T scale = 1 / static_cast<T>(p.batch * all * kept);
    double sum = 0;
    for (std::size_t i = 0; i < work.batch.rows; ++i) {
        for (std::size_t c = 0; c < shape_.critics; ++c) {
            const std::size_t stride = above_.size();
            const QuantileHuber<T> row{
                .quantiles = work.critics[c].values.back().data() + i * stride,
                .targets = work.pool.data() + i * all,
                .above = above_.data(),
                .below = below_.data(),
                .slopes = work.critics[c].slopes.back().data() + i * stride,
                .n = stride,
                .m = kept,
                .scale = scale};
            kernels_->quantile_slopes(row);
            if (loss) sum += kernels_->quantile_loss(row);
        }
    }
    return sum;
}

template <class T>
double TqcLosses<T>::critic_part(const Parameters& p, Work& work, bool loss, T* gradient) const
{
    const Transitions<T>& batch = work.batch;
    make_targets(p, work);
    const Rows<const T> pairs{batch.pairs.data(), batch.pair_stride()};
    for (std::size_t c = 0; c < shape_.critics; ++c) {
        critic_.forward(p.critics + c * critic_.size(), pairs, batch.rows, work.critics[c]);
    }
    const double sum = huber(work, p, loss);
    for (std::size_t c = 0; c < shape_.critics; ++c) {
        critic_.backward(p.critics_transposed + c * critic_.transposed_size(), pairs, batch.rows,
                         work.critics[c], gradient + c * critic_.size(), nullptr);
    }
    return sum;
}

template <class T>
ActorSums TqcLosses<T>::actor_part(const Parameters& p, Work& work, T* gradient) const
{
    const Transitions<T>& batch = work.batch;
    const Rows<const T> states{batch.states.data(), batch.stride()};
    const Rows<T> pairs{work.pairs.data(), batch.pair_stride()};
    const Rows<T> by_action{work.by_action.data(), padded<T>(shape_.actions)};
    actor_.forward(p.actor, *p.noise, states, batch.rows, work.actor);
    join<T>(states, shape_.observations, {work.actor.actions.data(), by_action.stride},
            shape_.actions, batch.rows, pairs);

    const T share = 1 / static_cast<T>(p.batch * shape_.critics * shape_.quantiles);
    std::fill(work.by_action.begin(), work.by_action.end(), T(0));
    double value = 0;
    for (std::size_t c = 0; c < shape_.critics; ++c) {
        typename BatchMlp<T>::Work& critic = work.critics[c];
        const Rows<const T> in{pairs.data, pairs.stride};
        const Rows<T> z = critic_.forward(p.critics + c * critic_.size(), in, batch.rows, critic);
        const Rows<T> by_z = critic_.slopes_out(critic);
        for (std::size_t i = 0; i < batch.rows; ++i) {
            T row = 0;
            for (std::size_t j = 0; j < shape_.quantiles; ++j) row += z.row(i)[j];
            value += static_cast<double>(row);
            std::fill_n(by_z.row(i), shape_.quantiles, -share);
        }
        critic_.backward(p.critics_transposed + c * critic_.transposed_size(), in, batch.rows,
                         critic, nullptr, work.by_pair.data());
        for (std::size_t i = 0; i < batch.rows; ++i) {
            const T* from = work.by_pair.data() + i * pairs.stride + shape_.observations;
            for (std::size_t a = 0; a < shape_.actions; ++a) by_action.row(i)[a] += from[a];
        }
    }
    actor_.backward(*p.noise, states, batch.rows, {by_action.data, by_action.stride},
                    p.temperature / static_cast<T>(p.batch), work.actor, gradient);

    ActorSums sums;
    for (std::size_t i = 0; i < batch.rows; ++i) {
        sums.log_density += static_cast<double>(work.actor.log_density[i]);
    }
    sums.loss =
        static_cast<double>(p.temperature) * sums.log_density / static_cast<double>(p.batch) -
        static_cast<double>(share) * value;
    return sums;
}

template class TqcLosses<float>;
template class TqcLosses<double>;

}  // namespace ricochet::learn
