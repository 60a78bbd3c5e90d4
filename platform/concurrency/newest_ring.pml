/* NewestRing of newest_ring.h, with the names used there. The values are the numbers of BUFFERS buffers that the
 * producer fills before pushing. A buffer that was evicted is its own again at once; the consumer keeps the buffer it
 * popped last until it is done with the next one, as the tracker does, and buffers it is done with come back through a
 * release and an acquire. The producer waits for a buffer when none is free, and pauses now and then until all have
 * come back but the one the consumer keeps. Runs are endless. Memory: see weak_memory.pml; a load of the word, also
 * that of a replacement that fails, may return any value since the thread's last access.
 *
 * Checked: each value leaves the ring once and into one hand, as popped, evicted or overtaken; no access to a buffer
 * is a race; values come in order, and when one was evicted the next pop gives the newest at once and leaves none
 * behind; a side fails at most N times to replace the word; the producer always gets a buffer again, and all
 * buffers but one in a pause (the camera does not starve).
 * Left out: the counters. */
#ifndef N
#define N 2
#endif
#ifndef BUFFERS
#define BUFFERS 4
#endif
#define THREADS 2
#define SLOTS BUFFERS
#define MESSAGES (BUFFERS + 1) /* one for each buffer's way back; one in the word */
#include "weak_memory.pml"

#ifndef kPublish
#define kPublish RELEASE
#endif
#ifndef kObserve
#define kObserve ACQUIRE
#endif
#ifndef COMPARE /* 0: the consumer replaces the word without comparing it */
#define COMPARE 1
#endif
#ifndef TAKE_ALL /* 0: after an overflow the consumer takes the newest value only */
#define TAKE_ALL 1
#endif
#ifndef VISIT /* 0: the visitor is not called: overtaken buffers do not come back */
#define VISIT 1
#endif

#define kProducer 0
#define kConsumer 1
#define kNone 255
#define kMessageOfWord BUFFERS
#define message_of_return(buffer) (buffer)

#define forget(views, buffer) views = views & ~(access_of(kProducer, buffer) | access_of(kConsumer, buffer))

#define kLaneBits 4
#define kLane ((1 << kLaneBits) - 1)
#define kOverflow (1 << (N * kLaneBits))
#define lane(word, i) (((word) >> ((i) * kLaneBits)) & kLane)
#define oldest(word) (lane(word, 0) - 1)
#define is_full(word) (lane(word, N - 1) != 0)

#define kFree 0 /* where a buffer is */
#define kWithProducer 1
#define kInRing 2
#define kWithConsumer 3

int word;
int seen[THREADS];       /* what a load of the word returns to a thread */
byte place[BUFFERS];
byte number_free = BUFFERS;
byte line[N], waiting;   /* what must be in the ring, the oldest first */
bit behind;              /* a value was evicted since the last pop */
hidden byte place_in_line, free_one, fill;

active [THREADS] proctype memory() {
  do
  :: atomic { seen[_pid] != word -> seen[_pid] = word }
  od
}

/* What a replacement that fails returns: the newest word, or an older one that differs from the expected. */
inline failing(me) {
  failures++;
  assert(failures <= N);
  if
  :: expected = word; seen[me] = word
  :: seen[me] != expected -> expected = seen[me]
  fi
}

inline first_leaves_line() {
  d_step {
    place_in_line = 1;
    do
    :: place_in_line < waiting -> line[place_in_line - 1] = line[place_in_line]; place_in_line++
    :: else -> break
    od;
    waiting--;
    line[waiting] = 0;
    place_in_line = 0
  }
}

/* Of all that the release carries only what concerns this buffer is kept, and nothing else is remembered of it: fewer
 * states, and at most more races. */
inline frees(me, buffer) {
  storing(me, message_of_return(buffer), RELEASE);
  released[message_of_return(buffer)] = released[message_of_return(buffer)] & access_of(kConsumer, buffer);
  forget(view[kProducer], buffer);
  forget(view[kConsumer], buffer);
  forget(released[kMessageOfWord], buffer);
  place[buffer] = kFree;
  number_free++
}

active proctype producer() {
  int expected;
  byte value, evicted, failures;
  do
  :: if
     :: true -> number_free > 0
     :: true -> number_free >= BUFFERS - 1
     fi;
     atomic {
       free_one = 0;
       do
       :: place[free_one] != kFree -> free_one++
       :: else -> break
       od;
       value = free_one;
       place[value] = kWithProducer;
       number_free--;
       loading(kProducer, message_of_return(value), ACQUIRE);
       released[message_of_return(value)] = 0
     };
has_buffer:
     atomic { access(kProducer, value, access_of(kConsumer, value)); expected = seen[kProducer] };
     /* push() */
     do
     :: atomic {
          if
          :: word == expected ->
             modifying(kProducer, kMessageOfWord, kPublish);
             if
             :: is_full(expected) ->
                evicted = oldest(expected);
                word = ((expected & (kOverflow - 1)) >> kLaneBits) | ((value + 1) << ((N - 1) * kLaneBits)) | kOverflow
             :: else ->
                evicted = kNone;
                fill = 0;
                do
                :: lane(expected, fill) != 0 -> fill++
                :: else -> break
                od;
                word = expected | ((value + 1) << (fill * kLaneBits));
                fill = 0
             fi;
             seen[kProducer] = word;
             if
             :: waiting == N ->
                assert(evicted == line[0] && place[evicted] == kInRing);
                first_leaves_line();
                place[evicted] = kWithProducer;
                behind = 1
             :: else -> assert(evicted == kNone)
             fi;
             line[waiting] = value;
             waiting++;
             place[value] = kInRing;
             break
          :: else -> failing(kProducer)
          fi
        }
     od;
     /* what was evicted may be written again at once */
     atomic {
       if
       :: evicted != kNone -> access(kProducer, evicted, access_of(kConsumer, evicted)); frees(kProducer, evicted)
       :: else
       fi;
       expected = 0;
       value = 0;
       evicted = 0;
       failures = 0
     }
  od
}

inline leaves_for_consumer(buffer) {
  assert(place[buffer] == kInRing);
  place[buffer] = kWithConsumer
}

active proctype consumer() {
  int expected;
  byte value, previous = kNone, failures;
  do
  :: /* pop() */
     expected = seen[kConsumer];
     do
     :: expected == 0 -> break
     :: expected != 0 && !(expected & kOverflow) ->
        atomic {
          if
          :: word == expected || !COMPARE ->
             modifying(kConsumer, kMessageOfWord, kObserve);
             value = oldest(expected);
             word = expected >> kLaneBits;
             seen[kConsumer] = word;
             assert(!behind && value == line[0]);
             leaves_for_consumer(value);
             first_leaves_line();
             goto popped
          :: else -> failing(kConsumer)
          fi
        }
     :: expected & kOverflow ->
        atomic {
          modifying(kConsumer, kMessageOfWord, kObserve);
          expected = word & (kOverflow - 1);
#if TAKE_ALL
          word = 0;
#else
          word = word & ((1 << ((N - 1) * kLaneBits)) - 1);
#endif
          seen[kConsumer] = word;
          assert(behind && waiting == N);
          behind = 0;
          do
          :: waiting > 0 ->
             assert(oldest(expected >> ((N - waiting) * kLaneBits)) == line[0]);
             leaves_for_consumer(line[0]);
             first_leaves_line()
          :: else -> break
          od
        };
        do
        :: atomic {
             N > 1 && lane(expected, 1) != 0 ->
#if VISIT
             assert(place[oldest(expected)] == kWithConsumer);
             frees(kConsumer, oldest(expected));
#endif
             expected = expected >> kLaneBits
           }
        :: N == 1 || lane(expected, 1) == 0 -> break
        od;
        value = oldest(expected);
        goto popped
     od;
     /* kNone: parked until there is something */
     seen[kConsumer] != 0;
     goto next;
popped:
     /* the tracker compares it with the one before, which it has kept */
     atomic {
       access(kConsumer, value, access_of(kProducer, value));
       if
       :: previous != kNone ->
          access(kConsumer, previous, access_of(kProducer, previous));
          assert(place[previous] == kWithConsumer && place[value] == kWithConsumer);
          frees(kConsumer, previous)
       :: else
       fi;
       previous = value
     };
next:
     atomic { expected = 0; value = 0; failures = 0 }
  od
}

ltl does_not_starve { [] <> (producer@has_buffer) }
