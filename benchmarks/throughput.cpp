// How fast this processor divides and takes square roots, in nanoseconds per number: many at a
// time in the first-level cache, and one after the other where each needs the one before.
//
// Prints "sqrt 0.71 div 0.41 chain 21.3": the last is what one link of a chain of rigid links
// waits for, from its first node to its second, in the order of a textbook's operations.

#include <chrono>
#include <cmath>
#include <cstdio>

static double numbers[512], results[512];

template <typename Work> double nanoseconds(long count, Work work) {
    double best = 1e300;
    for (int repeat = 0; repeat < 15; repeat++) {
        const auto started = std::chrono::steady_clock::now();
        work();
        const std::chrono::duration<double, std::nano> took =
            std::chrono::steady_clock::now() - started;
        if (took.count() / count < best) best = took.count() / count;
    }
    return best;
}

int main() {
    const int rounds = 2000;
    for (int i = 0; i < 512; i++) numbers[i] = 1.0 + i * 1e-3;
    const double sqrt_ns = nanoseconds(512L * rounds, [] {
        for (int round = 0; round < rounds; round++) {
            for (int i = 0; i < 512; i++) results[i] = std::sqrt(numbers[i]);
            asm volatile("" ::"r"(numbers), "r"(results) : "memory");
        }
    });
    const double div_ns = nanoseconds(512L * rounds, [] {
        for (int round = 0; round < rounds; round++) {
            for (int i = 0; i < 512; i++) results[i] = 3.0 / numbers[i];
            asm volatile("" ::"r"(numbers), "r"(results) : "memory");
        }
    });
    double x = 0.1, y = 0.2;
    const double chain_ns = nanoseconds(100000, [&] {
        for (int link = 0; link < 100000; link++) {
            const double dx = 1.3 - x, dy = 0.7 - y;
            const double excess = 0.5 * (1.0 - 0.9 / std::sqrt(dx * dx + dy * dy));
            x = 1.3 - excess * dx;
            y = 0.7 - excess * dy;
            asm volatile("" : "+x"(x), "+x"(y));
        }
    });
    std::printf("sqrt %.4g div %.4g chain %.4g\n", sqrt_ns, div_ns, chain_ns);
}
