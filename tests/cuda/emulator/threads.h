// Executes the threads of a kernel's grid on the processor. The emulated compiler puts this before the source of every kernel.
//
// A thread that must wait for others, at `__syncthreads` or in an exchange within its warp, is set aside with its stack; the
// others go on. Blocks run one after the other, so that what `__shared__` declares belongs to one block at a time.

#include <cmath>
#include <csetjmp>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <functional>
#include <memory>
#include <tuple>
#include <ucontext.h>
#include <utility>
#include <vector>

using std::fabs, std::floor, std::fma, std::fmax, std::fmin, std::isfinite, std::sqrt, std::size_t;

namespace emulator {

struct Index {
    unsigned x = 0, y = 0, z = 0;
};

// Threads that wait for each other.
struct Barrier {
    unsigned alive = 0, waiting = 0, generation = 0;

    void end_if_all_wait() {
        if (waiting > 0 && waiting == alive) waiting = 0, generation++;
    }
};

constexpr unsigned WARP = 32;

struct Warp {
    Barrier barrier;
    // Two exchanges: no thread begins the one after next before all have read.
    std::uint64_t values[2][WARP];
    unsigned exchanges[WARP];
};

// A place in a thread's execution to which the processor can jump. The functions of the compiler save less, and are faster.
#if defined(__x86_64__)
using Place = void *[5];
#define EMULATOR_SAVE(place) __builtin_setjmp(place)
#define EMULATOR_JUMP(place) __builtin_longjmp(place, 1)
#else
using Place = std::jmp_buf;
#define EMULATOR_SAVE(place) _setjmp(place)
#define EMULATOR_JUMP(place) _longjmp(place, 1)
#endif

// A stack on which threads run, one after the other unless one waits.
struct Fiber {
    static constexpr size_t STACK = 1 << 18;
    std::unique_ptr<char[]> stack{new char[STACK]};
    ucontext_t context;
    Place place;
    unsigned thread = 0;
};

struct Block {
    std::function<void()> *body = nullptr;
    unsigned threads = 0, next = 0;
    Barrier barrier;
    std::vector<Warp> warps;
    std::vector<std::unique_ptr<Fiber>> fibers;
    std::vector<Fiber *> idle;
    std::deque<Fiber *> waiting;
    Fiber *running = nullptr;
    Place scheduler;
    // How often a thread found that it must still wait, since one got further.
    unsigned in_vain = 0;

    void run(unsigned count, std::function<void()> &of_thread);
    void start();
    void set_aside(Barrier &at);
    void go_on(Fiber *fiber);
    [[noreturn]] void jump_to_next();
    [[noreturn]] void jump_to_scheduler();
    [[noreturn]] void execute(Fiber *fiber);
};

inline thread_local Block block;

} // namespace emulator

inline thread_local emulator::Index threadIdx, blockIdx, blockDim, gridDim;

namespace emulator {

inline void enter() { block.execute(block.running); }

// Runs threads until none is left; then the processor goes on with those that wait, if any.
[[noreturn]] inline void Block::execute(Fiber *fiber) {
    for (;;) {
        while (next < threads) {
            fiber->thread = next++;
            threadIdx.x = fiber->thread;
            (*body)();
            in_vain = 0;
            Warp &warp = warps[fiber->thread / WARP];
            for (Barrier *of : {&warp.barrier, &barrier}) of->alive--, of->end_if_all_wait();
        }
        idle.push_back(fiber);
        if (EMULATOR_SAVE(fiber->place) == 0) jump_to_next();
    }
}

// The compiler allows no jump in a function that saves a place.
[[noreturn, gnu::noinline]] inline void Block::jump_to_scheduler() { EMULATOR_JUMP(scheduler); }

[[noreturn, gnu::noinline]] inline void Block::jump_to_next() {
    if (next < threads || waiting.empty()) jump_to_scheduler();
    running = waiting.front();
    waiting.pop_front();
    threadIdx.x = running->thread;
    EMULATOR_JUMP(running->place);
}

// Lets the other threads go on until all have come to the barrier.
[[gnu::noinline]] inline void Block::set_aside(Barrier &at) {
    Fiber *const fiber = running;
    const unsigned generation = at.generation;
    at.waiting++;
    in_vain = 0;
    at.end_if_all_wait();
    while (at.generation == generation) {
        if (in_vain++ > 2 * threads) {
            std::fprintf(stderr, "emulated device: threads of a block wait for threads that never come\n");
            std::abort();
        }
        waiting.push_back(fiber);
        if (EMULATOR_SAVE(fiber->place) == 0) jump_to_next();
    }
}

[[gnu::noinline]] inline void Block::go_on(Fiber *fiber) { EMULATOR_JUMP(fiber->place); }

// Starts threads on a stack that is free, or on a new one; returns when one waits while others have not begun, or all have ended.
[[gnu::noinline]] inline void Block::start() {
    if (EMULATOR_SAVE(scheduler) != 0) return;
    if (!idle.empty()) {
        running = idle.back();
        idle.pop_back();
        go_on(running);
    }
    fibers.push_back(std::make_unique<Fiber>());
    running = fibers.back().get();
    getcontext(&running->context);
    running->context.uc_stack.ss_sp = running->stack.get();
    running->context.uc_stack.ss_size = Fiber::STACK;
    makecontext(&running->context, enter, 0);
    setcontext(&running->context);
}

inline void Block::run(unsigned count, std::function<void()> &of_thread) {
    body = &of_thread, threads = count, next = 0;
    barrier = {count, 0, 0};
    warps.assign((count + WARP - 1) / WARP, Warp{});
    for (unsigned k = 0; k < warps.size(); k++) warps[k].barrier.alive = k * WARP + WARP > count ? count - k * WARP : WARP;
    while (next < threads) start();
}

// The value that lane `from(lane)` of the warp passes; that of the lane itself if there is no such lane.
template <typename T, typename From> T exchange(unsigned mask, T value, From from) {
    static_assert(sizeof(T) <= sizeof(std::uint64_t), "a value of at most eight bytes");
    Block &of_thread = block;
    const unsigned thread = of_thread.running->thread, lane = thread % WARP;
    Warp &warp = of_thread.warps[thread / WARP];
    const unsigned number = warp.exchanges[lane]++;
    std::uint64_t *values = warp.values[number % 2];
    std::memcpy(&values[lane], &value, sizeof value);
    of_thread.set_aside(warp.barrier);
    const unsigned source = from(lane);
    if (mask != 0xffffffffu || (source < WARP && warp.exchanges[source] <= number)) {
        std::fprintf(stderr, "emulated device: an exchange in which not all threads of the warp take part\n");
        std::abort();
    }
    if (source < WARP) std::memcpy(&value, &values[source], sizeof value);
    return value;
}

// A launch whose arguments are copied, as a device does.
struct Launch {
    Index grid, threads;
    std::function<void()> of_thread;

    void run() {
        gridDim = grid, blockDim = threads;
        for (blockIdx.x = 0; blockIdx.x < grid.x; blockIdx.x++) block.run(threads.x, of_thread);
    }
};

template <typename... A, size_t... I>
std::function<void()> bound(void (*kernel)(A...), void **arguments, std::index_sequence<I...>) {
    std::tuple<std::decay_t<A>...> copies(*static_cast<std::decay_t<A> *>(arguments[I])...);
    return [kernel, copies]() { std::apply(kernel, copies); };
}

template <typename... A> std::function<void()> bound(void (*kernel)(A...), void **arguments) {
    return bound(kernel, arguments, std::index_sequence_for<A...>{});
}

} // namespace emulator

#define __global__
#define __device__
#define __forceinline__ inline
#define __launch_bounds__(threads)
#define __shared__ static thread_local

inline void __syncthreads() { emulator::block.set_aside(emulator::block.barrier); }
inline void __threadfence() {}
template <typename T> T __shfl_sync(unsigned mask, T value, unsigned source) {
    return emulator::exchange(mask, value, [=](unsigned) { return source % emulator::WARP; });
}
template <typename T> T __shfl_down_sync(unsigned mask, T value, unsigned offset) {
    return emulator::exchange(mask, value, [=](unsigned lane) { return lane + offset; });
}
inline unsigned atomicAdd(unsigned *address, unsigned value) {
    return __atomic_fetch_add(address, value, __ATOMIC_SEQ_CST);
}
inline double __dadd_rn(double a, double b) { return a + b; }
inline double __dmul_rn(double a, double b) { return a * b; }
inline unsigned long long __double_as_longlong(double x) {
    unsigned long long bits;
    std::memcpy(&bits, &x, sizeof bits);
    return bits;
}
inline double __longlong_as_double(unsigned long long bits) {
    double x;
    std::memcpy(&x, &bits, sizeof x);
    return x;
}
