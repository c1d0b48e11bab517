/* Arithmetic, comparisons and logic, where a computation may fail: `bad` is 0 or a failure. */
enum { CHART_ERROR = -1, CHART_OVERFLOWED = -2 };
struct chart_int {
    int64_t value;
    int bad;
};
struct chart_num {
    double value;
    int bad;
};

static inline struct chart_int chart_int(int64_t value)
{
    const struct chart_int result = {value, 0};
    return result;
}

static inline struct chart_int chart_no_int(int bad)
{
    const struct chart_int result = {0, bad};
    return result;
}

static inline struct chart_num chart_num(double value)
{
    const struct chart_num result = {value, 0};
    return result;
}

static inline struct chart_num chart_no_num(int bad)
{
    const struct chart_num result = {0.0, bad};
    return result;
}

static inline struct chart_num chart_finite(double value)
{
    return value >= -DBL_MAX && value <= DBL_MAX ? chart_num(value) : chart_no_num(CHART_ERROR);
}

static inline struct chart_num chart_widen(struct chart_int a)
{
    const int64_t exact = INT64_C(9007199254740992);
    if (a.bad) {
        return chart_no_num(a.bad);
    }
    return a.value >= -exact && a.value <= exact ? chart_num((double)a.value) : chart_no_num(CHART_OVERFLOWED);
}

static inline struct chart_int chart_whole(struct chart_num a)
{
    if (a.bad) {
        return chart_no_int(a.bad);
    }
    if (!(a.value >= -9223372036854775808.0 && a.value < 9223372036854775808.0)) {
        return chart_no_int(CHART_OVERFLOWED);
    }
    return (double)(int64_t)a.value == a.value ? chart_int((int64_t)a.value) : chart_no_int(CHART_ERROR);
}

static inline struct chart_int chart_add_int(struct chart_int a, struct chart_int b)
{
    if (a.bad || b.bad) {
        return chart_no_int(a.bad ? a.bad : b.bad);
    }
    if (b.value > 0 ? a.value > INT64_MAX - b.value : a.value < INT64_MIN - b.value) {
        return chart_no_int(CHART_OVERFLOWED);
    }
    return chart_int(a.value + b.value);
}

static inline struct chart_int chart_sub_int(struct chart_int a, struct chart_int b)
{
    if (a.bad || b.bad) {
        return chart_no_int(a.bad ? a.bad : b.bad);
    }
    if (b.value > 0 ? a.value < INT64_MIN + b.value : a.value > INT64_MAX + b.value) {
        return chart_no_int(CHART_OVERFLOWED);
    }
    return chart_int(a.value - b.value);
}

static inline bool chart_mul_overflows(int64_t a, int64_t b)
{
    if (a == 0 || b == 0) {
        return false;
    }
    if (a > 0) {
        return b > 0 ? a > INT64_MAX / b : b < INT64_MIN / a;
    }
    return b > 0 ? a < INT64_MIN / b : b < INT64_MAX / a;
}

static inline struct chart_int chart_mul_int(struct chart_int a, struct chart_int b)
{
    if (a.bad || b.bad) {
        return chart_no_int(a.bad ? a.bad : b.bad);
    }
    return chart_mul_overflows(a.value, b.value) ? chart_no_int(CHART_OVERFLOWED) : chart_int(a.value * b.value);
}

static inline struct chart_int chart_neg_int(struct chart_int a)
{
    return chart_sub_int(chart_int(0), a);
}

static inline struct chart_num chart_add_num(struct chart_num a, struct chart_num b)
{
    return a.bad || b.bad ? chart_no_num(a.bad ? a.bad : b.bad) : chart_finite(a.value + b.value);
}

static inline struct chart_num chart_sub_num(struct chart_num a, struct chart_num b)
{
    return a.bad || b.bad ? chart_no_num(a.bad ? a.bad : b.bad) : chart_finite(a.value - b.value);
}

static inline struct chart_num chart_mul_num(struct chart_num a, struct chart_num b)
{
    return a.bad || b.bad ? chart_no_num(a.bad ? a.bad : b.bad) : chart_finite(a.value * b.value);
}

static inline struct chart_num chart_div_num(struct chart_num a, struct chart_num b)
{
    if (a.bad || b.bad) {
        return chart_no_num(a.bad ? a.bad : b.bad);
    }
    return b.value == 0.0 ? chart_no_num(CHART_ERROR) : chart_finite(a.value / b.value);
}

static inline struct chart_num chart_neg_num(struct chart_num a)
{
    return a.bad ? a : chart_num(-a.value);
}

static inline struct chart_int chart_between_int(struct chart_int a, struct chart_int least, struct chart_int most)
{
    return a.bad || (least.value <= a.value && a.value <= most.value) ? a : chart_no_int(CHART_ERROR);
}

static inline struct chart_num chart_between_num(struct chart_num a, struct chart_num least, struct chart_num most)
{
    return a.bad || (least.value <= a.value && a.value <= most.value) ? a : chart_no_num(CHART_ERROR);
}

/* The seconds of a timer, which are a failure if they are too few. */
static inline struct chart_num chart_lasting(struct chart_num a, double least)
{
    return a.bad || a.value >= least ? a : chart_no_num(CHART_ERROR);
}

/* The result of a condition is 1 (true), 0 (false) or a failure. */
static inline int chart_eq_int(struct chart_int a, struct chart_int b)
{
    return a.bad ? a.bad : b.bad ? b.bad : a.value == b.value;
}

static inline int chart_lt_int(struct chart_int a, struct chart_int b)
{
    return a.bad ? a.bad : b.bad ? b.bad : a.value < b.value;
}

static inline int chart_le_int(struct chart_int a, struct chart_int b)
{
    return a.bad ? a.bad : b.bad ? b.bad : a.value <= b.value;
}

static inline int chart_eq_num(struct chart_num a, struct chart_num b)
{
    return a.bad ? a.bad : b.bad ? b.bad : a.value == b.value;
}

static inline int chart_lt_num(struct chart_num a, struct chart_num b)
{
    return a.bad ? a.bad : b.bad ? b.bad : a.value < b.value;
}

static inline int chart_le_num(struct chart_num a, struct chart_num b)
{
    return a.bad ? a.bad : b.bad ? b.bad : a.value <= b.value;
}

/* One that is false decides also if the other one failed. */
static inline int chart_both(int a, int b)
{
    return a == 0 || b == 0 ? 0 : a == 1 ? b : a;
}

/* One that is true decides also if the other one failed. */
static inline int chart_either(int a, int b)
{
    return a == 1 || b == 1 ? 1 : a == 0 ? b : a;
}

static inline int chart_opposite(int a)
{
    return a < 0 ? a : !a;
}

static inline int64_t chart_take_int(struct chart_int a, int *bad)
{
    *bad = *bad ? *bad : a.bad;
    return a.value;
}

static inline double chart_take_num(struct chart_num a, int *bad)
{
    *bad = *bad ? *bad : a.bad;
    return a.value;
}

static inline bool chart_take_truth(int a, int *bad)
{
    *bad = *bad ? *bad : a < 0 ? a : 0;
    return a == 1;
}

static inline void chart_emit(struct chart *c, int event, const struct chart_attributes *data)
{
    if (c->host.emit) {
        c->host.emit(c->host.context, event, data);
    }
}

static inline void chart_command(struct chart *c, int command, const struct chart_arguments *arguments)
{
    if (c->host.command) {
        c->host.command(c->host.context, command, arguments);
    }
}

static inline void chart_start(struct chart *c, int activity, const struct chart_arguments *arguments)
{
    c->run[activity] = ++c->runs;
    c->running[activity] = true;
    if (chart_activities[activity].timer >= 0) {
        chart_arm(c, chart_activities[activity].timer);
    }
    if (c->host.start) {
        c->host.start(c->host.context, activity, c->run[activity], arguments);
    }
}
